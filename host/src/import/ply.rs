//! PLY files (Turk 1994): text or binary of either byte order in, one polygon mesh out.
//!
//! Read are `x y z` and, where all three are there, `nx ny nz` of the element `vertex`, and the
//! list `vertex_indices` (or `vertex_index`) of the element `face`. Other elements and properties
//! are stepped over. Counts of the header are held against the bytes that follow before anything
//! is reserved for them.

mod data;
mod header;
#[cfg(test)]
mod tests;

use glam::DVec3;

use super::text::{check_unit, file_stem};
use super::{ImportError, ImportErrorKind, Notice, Place, RawMesh, RawPrimitive};
use data::Values;
use header::{Header, Kind};

/// Reads a PLY file; `file` is its name for messages, `unit_metres` the length of its unit, which
/// the format does not state.
///
/// Positions `[vertices]` in metres, in file order. O(bytes).
///
/// # Errors
/// [`ImportError`] with the line or the byte: another format, a header that contradicts itself or
/// announces more than the file holds, a coordinate that is not a finite number, an index that
/// does not exist, no face at all. Faces with fewer than three corners are left out with a
/// [`Notice`].
pub fn read_ply(
    bytes: &[u8],
    file: &str,
    unit_metres: f64,
) -> Result<(RawMesh, Vec<Notice>), ImportError> {
    let header = Header::read(bytes).map_err(|fault| at(file, fault))?;
    let (mesh, values) = elements(bytes, &header, file, unit_metres)?;
    mesh.finish(&values, file).map_err(|fault| at(file, fault))
}

/// Reads the vertices of a PLY file that may have no faces, as [`read_ply`] does: a point cloud.
///
/// # Errors
/// As [`read_ply`], but for missing faces.
pub fn read_ply_points(
    bytes: &[u8],
    file: &str,
    unit_metres: f64,
) -> Result<Vec<DVec3>, ImportError> {
    let header = Header::read(bytes).map_err(|fault| at(file, fault))?;
    let (mesh, _) = elements(bytes, &header, file, unit_metres)?;
    if mesh.positions.is_empty() {
        let what = "every vertex".to_owned();
        return Err(ImportErrorKind::Missing { what }.at(file, Place::File));
    }
    Ok(mesh.positions)
}

fn at(file: &str, (place, kind): Fault) -> ImportError {
    kind.at(file, place)
}

/// All elements, and what stands behind them.
fn elements<'b>(
    bytes: &'b [u8],
    header: &Header,
    file: &str,
    unit_metres: f64,
) -> Result<(Mesh, Values<'b>), ImportError> {
    let unit_metres = check_unit(unit_metres).map_err(|kind| kind.at(file, Place::File))?;
    let mut values = Values::new(bytes, header);
    let mut mesh = Mesh::default();
    for element in &header.elements {
        let fits = header.fits(element, values.remaining());
        fits.map_err(|fault| at(file, fault))?;
        match element.name.as_str() {
            "vertex" if mesh.positions.is_empty() => {
                let places = element.vertex_places().map_err(|fault| at(file, fault))?;
                mesh.read_vertices(&mut values, element, &places, unit_metres)
            }
            "face" => mesh.read_faces(&mut values, element),
            _ => skip(&mut values, element),
        }
        .map_err(|fault| at(file, fault))?;
    }
    Ok((mesh, values))
}

type Fault = (Place, ImportErrorKind);

#[derive(Default)]
struct Mesh {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    corners: Vec<u32>,
    polygon_sizes: Vec<u32>,
    short_faces: usize,
    face_count: usize,
}

impl Mesh {
    fn read_vertices(
        &mut self,
        values: &mut Values<'_>,
        element: &header::Element,
        places: &header::VertexPlaces,
        unit_metres: f64,
    ) -> Result<(), Fault> {
        let mut row = vec![0.0; element.properties.len()];
        for vertex in 0..element.count {
            values.start_row(&element.name, vertex, element.count)?;
            for (value, property) in row.iter_mut().zip(&element.properties) {
                *value = match property.kind {
                    Kind::Scalar(scalar) => values.scalar(scalar, &property.name)?,
                    Kind::List { .. } => {
                        values.list(property, |_| Ok(()))?;
                        0.0
                    }
                };
            }
            let vector = |at: [usize; 3]| DVec3::from_array(at.map(|at| row[at]));
            let position = vector(places.position);
            let limit = super::text::MAX_MAGNITUDE;
            if !position.to_array().iter().all(|x| x.abs() <= limit) {
                let what = format!("the position of vertex {vertex}");
                return Err((values.place(), ImportErrorKind::NotFinite { what }));
            }
            self.positions.push(position * unit_metres);
            if let Some(places) = places.normal {
                let normal = vector(places);
                let normal = if normal.is_finite() {
                    normal
                } else {
                    DVec3::ZERO
                };
                self.normals.push(normal.normalize_or_zero());
            }
        }
        Ok(())
    }

    fn read_faces(
        &mut self,
        values: &mut Values<'_>,
        element: &header::Element,
    ) -> Result<(), Fault> {
        let indices = element
            .properties
            .iter()
            .position(|p| matches!(p.name.as_str(), "vertex_indices" | "vertex_index"));
        self.face_count += element.count;
        for face in 0..element.count {
            values.start_row(&element.name, face, element.count)?;
            for (at, property) in element.properties.iter().enumerate() {
                if Some(at) != indices {
                    skip_property(values, property)?;
                    continue;
                }
                let first = self.corners.len();
                let count = self.positions.len();
                values.list(property, |index| {
                    if index >= 0.0 && index < count as f64 && index.fract() == 0.0 {
                        self.corners.push(index as u32);
                        return Ok(());
                    }
                    Err(ImportErrorKind::BadIndex {
                        what: format!("face {face} refers to vertex"),
                        index: index as i64,
                        count: count as u64,
                    })
                })?;
                let size = self.corners.len() - first;
                if size < 3 {
                    self.corners.truncate(first);
                    self.short_faces += 1;
                } else {
                    self.polygon_sizes.push(size as u32);
                }
            }
        }
        Ok(())
    }

    fn finish(self, values: &Values<'_>, file: &str) -> Result<(RawMesh, Vec<Notice>), Fault> {
        let missing = |what: &str| {
            let what = what.to_owned();
            Err((Place::File, ImportErrorKind::Missing { what }))
        };
        if self.positions.is_empty() {
            return missing("every vertex");
        }
        if self.polygon_sizes.is_empty() {
            return missing("every face with three corners (this is a point cloud)");
        }
        let mut notices = Vec::new();
        if self.short_faces > 0 {
            let text = format!(
                "{} of {} faces have fewer than three corners; they are left out",
                self.short_faces, self.face_count
            );
            notices.push(Notice::new(Place::File, text));
        }
        if values.remaining() > 0 && !values.only_space_left() {
            let text = format!(
                "{} bytes after the last face are ignored",
                values.remaining()
            );
            notices.push(Notice::new(values.place(), text));
        }
        let name = file_stem(file);
        let mesh = RawMesh {
            primitives: vec![RawPrimitive {
                name: name.clone(),
                corners: self.corners,
                polygon_sizes: self.polygon_sizes,
            }],
            name,
            normals: (self.normals.len() == self.positions.len()).then_some(self.normals),
            positions: self.positions,
            ..RawMesh::default()
        };
        Ok((mesh, notices))
    }
}

fn skip(values: &mut Values<'_>, element: &header::Element) -> Result<(), Fault> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for row in 0..element.count {
        values.start_row(&element.name, row, element.count)?;
        for property in &element.properties {
            skip_property(values, property)?;
        }
    }
    Ok(())
}

fn skip_property(values: &mut Values<'_>, property: &header::Property) -> Result<(), Fault> {
    match property.kind {
        Kind::Scalar(scalar) => values.scalar(scalar, &property.name).map(|_| ()),
        Kind::List { .. } => values.list(property, |_| Ok(())),
    }
}
