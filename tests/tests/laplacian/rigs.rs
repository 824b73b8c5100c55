//! A marked tube, and deformers with their memory.

use glam::{DQuat, DVec3};
use sinew_core::Level;
use sinew_core::asset::Dims;
use sinew_core::deform::Output;
use sinew_core::deform::laplacian::{
    MarkerPose, TurnReport, TurnState, exact_workspace_len, turn_state_len,
};
use sinew_host::fit::laplace::{
    CollapseOptions, CollapseReport, CollapsedTables, ExactTables, MarkerTarget, Surface,
    SurfaceOptions, collapse,
};
use sinew_tests::laplacian::tube;

pub(crate) fn poses(targets: &[MarkerTarget]) -> Vec<MarkerPose> {
    let pose = |target: &MarkerTarget| MarkerPose {
        position: target.position.as_vec3().to_array(),
        rotation: target.rotation.as_quat().to_array(),
    };
    targets.iter().map(pose).collect()
}

pub(crate) fn dims(vertex_count: usize) -> Dims {
    Dims {
        vertex_count,
        ..Dims::default()
    }
}

/// An exact deformer with its memory.
pub(crate) struct ExactRig<'t> {
    pub(crate) tables: &'t ExactTables,
    pub(crate) state: TurnState<Vec<f32>>,
    pub(crate) workspace: Vec<f32>,
    pub(crate) positions: Vec<f32>,
    pub(crate) level: Level,
}

impl<'t> ExactRig<'t> {
    pub(crate) fn new(tables: &'t ExactTables) -> Self {
        let (rows, markers) = (tables.order.len(), tables.marker_rows.len());
        Self {
            tables,
            state: TurnState::with(vec![0.0; turn_state_len(markers, rows)]),
            workspace: vec![0.0; exact_workspace_len(rows)],
            positions: vec![0.0; 3 * rows],
            level: Level::best(),
        }
    }

    pub(crate) fn step(&mut self, poses: &[MarkerPose]) -> TurnReport {
        let exact = self.tables.exact().expect("sound");
        let dims = dims(exact.row_count());
        let mut output = Output::separate(&dims, &mut self.positions, None).expect("fits");
        let (state, workspace) = (&mut self.state, &mut self.workspace);
        let report = exact.step(poses, 0, self.level, state, workspace, &mut output);
        report.expect("sizes fit")
    }

    pub(crate) fn vertices(&self) -> Vec<DVec3> {
        vertices(&self.positions)
    }
}

/// A collapsed deformer with its memory.
pub(crate) struct CollapsedRig<'t> {
    pub(crate) tables: &'t CollapsedTables,
    pub(crate) state: TurnState<Vec<f32>>,
    pub(crate) handles: Vec<[f32; 12]>,
    pub(crate) positions: Vec<f32>,
    pub(crate) normals: Vec<f32>,
    pub(crate) level: Level,
}

impl<'t> CollapsedRig<'t> {
    pub(crate) fn new(tables: &'t CollapsedTables) -> Self {
        let collapsed = tables.collapsed().expect("sound");
        let (markers, rows) = (collapsed.marker_count(), collapsed.virtual_count());
        Self {
            tables,
            state: TurnState::with(vec![0.0; turn_state_len(markers, rows)]),
            handles: vec![[0.0; 12]; collapsed.handle_count()],
            positions: vec![0.0; 3 * collapsed.vertex_count()],
            normals: vec![0.0; 3 * collapsed.vertex_count()],
            level: Level::best(),
        }
    }

    pub(crate) fn step(&mut self, poses: &[MarkerPose]) -> TurnReport {
        let collapsed = self.tables.collapsed().expect("sound");
        let report = collapsed.handles(poses, &mut self.state, &mut self.handles);
        let dims = dims(collapsed.vertex_count());
        let normals = Some(&mut self.normals[..]);
        let mut output = Output::separate(&dims, &mut self.positions, normals).expect("fits");
        let blocks = collapsed.block_count();
        collapsed.blocks(&self.handles, 0..blocks / 2, self.level, &mut output);
        collapsed.blocks(&self.handles, blocks / 2..blocks, self.level, &mut output);
        report.expect("sizes fit")
    }
}

pub(crate) fn vertices(numbers: &[f32]) -> Vec<DVec3> {
    let rows = numbers.as_chunks::<3>().0.iter();
    rows.map(|row| DVec3::from_array(row.map(f64::from)))
        .collect()
}

pub(crate) fn distances(found: &[DVec3], truth: &[DVec3]) -> CollapseReport {
    let pairs = found.iter().zip(truth);
    CollapseReport::new(pairs.map(|(a, b)| a.distance(*b)).collect())
}

pub(crate) fn show(what: &str, report: &CollapseReport) {
    let CollapseReport {
        mean,
        percentile_99,
        max,
    } = report;
    let [mean, p99, max] = [mean, percentile_99, max].map(|x| 1e3 * x);
    println!("{what:44} mean {mean:7.3}  p99 {p99:7.3}  max {max:7.3} mm");
}

/// A tube of 0.6 m with four markers at each end and two in the middle.
pub(crate) fn marked_tube() -> (Surface, Vec<[u32; 3]>, Vec<DVec3>) {
    marked_tube_with(&SurfaceOptions::default())
}

pub(crate) fn marked_tube_with(options: &SurfaceOptions) -> (Surface, Vec<[u32; 3]>, Vec<DVec3>) {
    let (positions, triangles, normals) = tube(41, 16);
    let ring = |ring: u32| [0, 4, 8, 12].map(|side| ring * 16 + side);
    let markers = [ring(0), ring(40)].concat();
    let surface = Surface::new(positions, &triangles, markers, options).expect("factors");
    (surface, triangles, normals)
}

/// The upper markers turned about the axis, and all of them about x.
pub(crate) fn twisted(surface: &Surface, twist: f64, bend: f64) -> Vec<MarkerTarget> {
    let target = |&position: &DVec3| {
        let upper = DQuat::from_rotation_y(if position.y > 0.3 { twist } else { 0.0 });
        let lean = DQuat::from_rotation_x(if position.y > 0.3 { bend } else { 0.0 });
        let rotation = lean * upper;
        let middle = DVec3::Y * 0.3;
        MarkerTarget {
            position: lean * (upper * position - middle) + middle,
            rotation,
        }
    };
    surface.marker_rest().iter().map(target).collect()
}

pub(crate) fn tube_poses(surface: &Surface) -> Vec<Vec<MarkerTarget>> {
    (0..40)
        .map(|k| {
            let k = f64::from(k);
            twisted(surface, 1.5 * (0.7 * k).sin(), 1.2 * (0.9 * k + 1.0).sin())
        })
        .collect()
}

pub(crate) fn fit_tube(
    surface: &Surface,
    triangles: &[[u32; 3]],
    normals: &[DVec3],
) -> CollapsedTables {
    let options = CollapseOptions {
        virtual_handles: 24,
        ..CollapseOptions::default()
    };
    collapse(surface, triangles, normals, &tube_poses(surface), &options).expect("fits")
}
