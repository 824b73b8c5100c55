//! Why a surface cannot be segmented.

/// Why a surface cannot be cut into near-rigid parts. Each carries the facts and ends with what to
/// do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentError {
    /// Nothing to segment.
    #[error("the surface has {triangles} triangles; give at least {needed}")]
    NoSurface {
        /// Triangles given.
        triangles: usize,
        /// Fewest that do.
        needed: usize,
    },
    /// A corner that does not exist.
    #[error(
        "triangle {triangle} refers to point {point}, and there are {count}; export the mesh again"
    )]
    BadTriangle {
        /// Which triangle.
        triangle: usize,
        /// The index.
        point: u32,
        /// Number of points.
        count: usize,
    },
    /// A frame of another length.
    #[error(
        "frame {frame} has {found} points and the surface {needed}; give the same mesh in all frames"
    )]
    FrameLength {
        /// Which frame.
        frame: usize,
        /// Its points.
        found: usize,
        /// Points of the surface.
        needed: usize,
    },
    /// A point of the reference shape that is no place.
    #[error("point {point} of the reference shape is not finite; choose another frame")]
    BadPoint {
        /// Which point.
        point: usize,
    },
    /// Nothing moves against anything else.
    #[error(
        "{frames} usable frames, where at least {needed} are needed; give a range-of-motion take, cleaned of gaps"
    )]
    FewFrames {
        /// Frames in which enough of the surface is seen.
        frames: usize,
        /// Fewest that do.
        needed: usize,
    },
    /// A count of parts that cannot be had.
    #[error("{wanted} parts wanted, where 1 to {most} can be had; change --parts")]
    PartCount {
        /// Parts asked for.
        wanted: usize,
        /// Most that are possible.
        most: usize,
    },
}
