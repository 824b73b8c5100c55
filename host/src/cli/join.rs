//! `sinew join`: a body cut into rigid parts becomes one skin.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use serde_json::{Value, json};

use super::Failure;
use super::load::{Reading, fault};
use super::register::{Body, write_bytes};
use super::rig::{Weighing, check_output, picture};
use super::say::{Say, thousands};
use crate::export::png::write_png;
use crate::export::write_glb_of;
use crate::fit::Humanoid;
use crate::fit::Which;
use crate::fit::cut::{JoinOptions, join};

/// Join a body that was cut into rigid parts into one closed skin with a skeleton.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew join cut.obj --output body.glb
  sinew join cut.obj --gap 0.05 --picture joined.png --output body.glb
  sinew join cut.obj --output body.glb && sinew bake --mesh body.glb --motion walk.bvh --output body.sinew

Every group of the OBJ is a part, open where it was cut, in the pose in which it was cut (T or A).
Facing borders are bridged; a joint with the part's name stands in the middle of each gap. Names that
say what a part is (Hips, LeftForeArm, r_thigh) let motion find its joint.")]
pub(crate) struct Join {
    /// The parts: an .obj with a group each.
    mesh: PathBuf,
    /// Widest gap to bridge, metres; by default as wide as the border's radius.
    #[arg(long, value_name = "METRES")]
    gap: Option<f64>,
    #[command(flatten)]
    weighing: Weighing,
    /// Where to write the body (.glb).
    #[arg(long, short)]
    output: PathBuf,
    /// Where to draw joints and weights (.png).
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

impl Join {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        check_output(&self.output)?;
        if self.gap.is_some_and(|gap| !(gap > 0.0 && gap.is_finite())) {
            return Err(Failure::Usage("--gap must be above 0 metres".into()));
        }
        let start = Instant::now();
        let body = Body::load(&self.mesh, self.reading, false, say)?;
        let mesh = body.mesh();
        let options = JoinOptions {
            gap: self.gap,
            weights: self.weighing.options(),
        };
        let (joined, report) = join(mesh, &options).map_err(|error| fault(&self.mesh, &error))?;
        let seconds = start.elapsed().as_secs_f64();
        let name = |part: usize| mesh.parts[part].name.as_str();
        for gap in &report.gaps {
            let [a, b] = gap.parts.map(name);
            say.line(format!("{a:>20} - {b:20} {:>6.1} mm wide", 1e3 * gap.width));
        }
        say.line(format!(
            "{} parts joined by {} triangles; {} holes between parts filled",
            mesh.parts.len(),
            thousands(report.added as u64),
            report.corners
        ));
        for (edges, centre) in &report.open {
            say.line(format!(
                "note: a border of {edges} edges around {centre:.3} faces no part and stays open"
            ));
        }
        for &part in &report.attached {
            say.line(format!(
                "note: {} touches no part; it hangs on the nearest",
                name(part)
            ));
        }
        let human = Humanoid::new(&joined.skeleton, Which::Target);
        if let Err(error) = &human {
            say.line(format!("note: motion will need --map: {error}"));
        }
        write_bytes(&self.output, &write_glb_of(&joined, &[])?)?;
        if let Some(path) = &self.picture {
            write_png(path, &picture(&joined))?;
        }
        say.line(format!("wrote {} in {seconds:.1} s", self.output.display()));
        let gaps = report.gaps.iter().map(|gap| {
            json!({
                "parts": gap.parts.map(name),
                "width_m": gap.width,
                "centre_m": gap.centre.to_array(),
            })
        });
        Ok(json!({
            "mesh": self.mesh.display().to_string(),
            "output": self.output.display().to_string(),
            "parts": mesh.parts.len(),
            "gaps": gaps.collect::<Vec<_>>(),
            "triangles_added": report.added,
            "corners_filled": report.corners,
            "open_borders": report.open.len(),
            "attached_parts": report.attached.iter().map(|&part| name(part)).collect::<Vec<_>>(),
            "is_human": human.is_ok(),
            "seconds": seconds,
        }))
    }
}
