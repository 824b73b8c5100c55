//! What a scan follows: captures, skeletons, bodies, folders of meshes.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::super::super::Failure;
use super::super::super::load::{self, Loaded, Reading, fault};
use super::super::super::say::Say;
use super::Laplacian;
use crate::clean::fill::{FillOptions, fill};
use crate::fit::laplace::{LaplaceError, Template};

impl Laplacian {
    /// The template and the file it came from.
    pub(super) fn template(
        &self,
        (markers, motion): (Option<&PathBuf>, &[PathBuf]),
        reading: Reading,
        say: &Say,
    ) -> Result<(PathBuf, Template), Failure> {
        let given = markers.or(self.template.as_ref());
        let path = match (given, motion) {
            (Some(path), []) => path,
            (None, [path]) => path,
            _ => {
                let text = "--mode laplacian needs one of --markers TAKE, --template FILE and \
                            --motion FILE.bvh: what the scan is to follow";
                return Err(Failure::Usage(text.into()));
            }
        };
        let at = |error: LaplaceError| fault(path, &error);
        if path.is_dir() {
            return Ok((path.clone(), self.sequence(path, reading, say)?));
        }
        let (loaded, notices) = load::any(path, reading)?;
        say.notices(&path.display().to_string(), &notices);
        let template = match loaded {
            Loaded::Motion(motion) => Template::of_motion(&motion),
            Loaded::Avatar(body) => {
                let still = crate::model::Clip::default();
                Template::of_body(&body, body.clips.first().unwrap_or(&still))
            }
            Loaded::Take(take) => {
                let missing = take.missing_fraction();
                let bar = say.progress("fill", take.marker_count());
                let filled = fill(&take, &FillOptions::default(), &|| bar.inc(1));
                bar.finish_and_clear();
                let (take, dropped) = complete(&filled.take).map_err(|e| fault(path, &e))?;
                if missing > 0.0 {
                    let name = path.display();
                    say.line(format!(
                        "note: {name}: {:.1} % of samples filled",
                        1e2 * missing
                    ));
                }
                if !dropped.is_empty() {
                    let names = dropped.join(", ");
                    say.line(format!(
                        "note: {}: markers with gaps that cannot be filled are left out: {names}",
                        path.display()
                    ));
                }
                Template::of_take(&take).map_err(at)?
            }
            Loaded::Mesh(_) | Loaded::Asset(_) => {
                let text = "a template moves; give a .bvh, a .glb with a clip, a marker capture, or \
                            a folder of meshes";
                return Err(Failure::Usage(format!("{}: {text}", path.display())));
            }
        };
        Ok((path.clone(), template))
    }

    /// A mesh or point cloud a frame, by file name.
    fn sequence(&self, folder: &Path, reading: Reading, say: &Say) -> Result<Template, Failure> {
        let entries = std::fs::read_dir(folder).map_err(|error| fault(folder, &error))?;
        let mut files: Vec<PathBuf> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|e| e == "ply" || e == "obj"))
            .collect();
        files.sort();
        let bar = say.progress("reading", files.len());
        let (mut frames, mut triangles) = (Vec::new(), Vec::new());
        for path in &files {
            let (points, corners) = load::frame(path, reading)?;
            let first = frames.first().map_or(points.len(), Vec::len);
            if points.len() != first {
                let text = format!(
                    "{}: {} points, where the first frame has {first}; export all with one \
                     connectivity",
                    path.display(),
                    points.len()
                );
                return Err(Failure::Data(text));
            }
            if frames.is_empty() {
                triangles = corners;
            }
            frames.push(points);
            bar.inc(1);
        }
        bar.finish_and_clear();
        Template::of_frames(frames, triangles, Vec::new(), self.template_rate)
            .map_err(|error| fault(folder, &error))
    }
}

/// The markers that are seen in every frame, and the names of the others.
fn complete(
    take: &crate::take::Take,
) -> Result<(crate::take::Take, Vec<String>), crate::take::TakeError> {
    let (mut labels, mut dropped, mut paths): (Vec<String>, Vec<String>, Vec<DVec3>) =
        (Vec::new(), Vec::new(), Vec::new());
    for (marker, label) in take.labels().iter().enumerate() {
        if take.missing_count(marker) == 0 {
            labels.push(label.clone());
            paths.extend_from_slice(take.trajectory(marker));
        } else {
            dropped.push(label.clone());
        }
    }
    Ok((take.with_trajectories(labels, paths)?, dropped))
}
