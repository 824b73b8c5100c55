//! Why a mesh cannot be driven by markers.

/// Why a mesh cannot be driven by markers. Each carries the facts and ends with what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LaplaceError {
    /// Nothing to deform.
    #[error("the mesh has no triangle with an area; give a triangle mesh, not a point cloud")]
    NoSurface,
    /// A vertex index that does not exist.
    #[error(
        "triangle {triangle} refers to vertex {vertex}, and there are {count}; export the mesh again"
    )]
    BadTriangle {
        /// Which triangle.
        triangle: usize,
        /// The index.
        vertex: u32,
        /// Number of vertices.
        count: usize,
    },
    /// NaN, infinite, or absurdly far.
    #[error("vertex {vertex} is at {position}, which is not a place; correct or remove it")]
    BadPosition {
        /// Which vertex.
        vertex: usize,
        /// Its coordinates.
        position: glam::DVec3,
    },
    /// Parts of the surface that nothing moves.
    #[error(
        "{} of the mesh without a marker: {}; put a marker on each, remove it, or attach it to its nearest neighbour",
        if .components.len() == 1 { "a component" } else { "components" },
        list(.components)
    )]
    Unmarked {
        /// What is known about each.
        components: Vec<Component>,
    },
    /// Too few to drive a surface, or more than an index holds.
    #[error("{count} markers, where 1 to {limit} can be used; change the marker file")]
    MarkerCount {
        /// Markers given.
        count: usize,
        /// Most that are possible.
        limit: usize,
    },
    /// A marker on a vertex that does not exist, or on one that has a marker already.
    #[error("marker {marker} sits on vertex {vertex}, {why}; move it")]
    BadMarker {
        /// Which marker.
        marker: usize,
        /// Its vertex.
        vertex: u32,
        /// What is wrong with it.
        why: &'static str,
    },
    /// Poses that do not fit the markers.
    #[error("pose {pose} has {found} markers and needs {needed}")]
    PoseLength {
        /// Which pose.
        pose: usize,
        /// Its markers.
        found: usize,
        /// Markers of the rig.
        needed: usize,
    },
    /// A marker that is not seen all the time.
    #[error("marker {marker} is missing in frame {frame}; fill gaps first (sinew clean)")]
    Gap {
        /// Its label.
        marker: String,
        /// Frame of the take, from 0.
        frame: usize,
    },
    /// A template that cannot move anything.
    #[error(
        "the template has no points, no frames, or frames with other numbers of points; export it again"
    )]
    NoTemplate,
    /// Points without extent.
    #[error("the {what} has no extent to align by; give pairs of markers in a file")]
    Flat {
        /// Template or scan.
        what: &'static str,
    },
    /// A line of a marker file that cannot be used.
    #[error("line {line} of the marker file: {why}")]
    MarkerLine {
        /// Counted from 1.
        line: usize,
        /// What is wrong and what to do.
        why: String,
    },
    /// The system has no unique solution in floating point.
    #[error("the system cannot be factored: triangles are too distorted; repair the mesh first")]
    NotPositiveDefinite,
    /// Memory or indices run out.
    #[error("{vertices} vertices are too many to factor; simplify the mesh")]
    TooLarge {
        /// Vertices.
        vertices: usize,
    },
}

/// A connected part of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// Its lowest vertex, in the source's numbering.
    pub vertex: u32,
    /// Number of vertices.
    pub vertices: usize,
    /// Middle of its bounding box, metres.
    pub centre: glam::DVec3,
}

fn list(components: &[Component]) -> String {
    const SHOWN: usize = 5;
    let mut words: Vec<String> = components
        .iter()
        .take(SHOWN)
        .map(|component| {
            let [x, y, z] = component.centre.to_array();
            let Component {
                vertex, vertices, ..
            } = component;
            format!(
                "{vertices} vertices from vertex {vertex} on, around ({x:.3}, {y:.3}, {z:.3}) m"
            )
        })
        .collect();
    if components.len() > SHOWN {
        words.push(format!("and {} more", components.len() - SHOWN));
    }
    words.join("; ")
}
