//! Wavefront OBJ: a triangle mesh with normals, as every program reads it.

use std::fmt::Write;

use crate::model::Mesh;

/// A mesh as the text of a `.obj`: metres, Y up, vertices in their order, a group for each part.
/// O(vertices + triangles)
#[must_use]
pub fn write_obj(mesh: &Mesh) -> String {
    let mut text = String::from("# sinew: metres, Y up\n");
    // A string takes any text.
    let mut line = |args: std::fmt::Arguments<'_>| {
        let _ = text.write_fmt(args);
        text.push('\n');
    };
    for at in &mesh.positions {
        line(format_args!("v {:.7} {:.7} {:.7}", at.x, at.y, at.z));
    }
    for coordinates in mesh.texcoords.iter().flatten() {
        // OBJ counts from the lower left, glTF from the upper left.
        line(format_args!(
            "vt {:.6} {:.6}",
            coordinates[0],
            1.0 - coordinates[1]
        ));
    }
    for normal in &mesh.normals {
        line(format_args!(
            "vn {:.6} {:.6} {:.6}",
            normal.x, normal.y, normal.z
        ));
    }
    let textured = mesh.texcoords.is_some();
    let corner = |at: u32| {
        let at = at + 1;
        if textured {
            format!("{at}/{at}/{at}")
        } else {
            format!("{at}//{at}")
        }
    };
    let mut next = mesh.parts.iter().peekable();
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        if let Some(part) = next.next_if(|part| part.triangles.start == index) {
            line(format_args!(
                "g {}",
                part.name.replace(char::is_whitespace, "_")
            ));
        }
        let [a, b, c] = triangle.map(corner);
        line(format_args!("f {a} {b} {c}"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::read_obj;
    use crate::model::Part;
    use glam::DVec3;

    #[test]
    fn what_is_written_is_read_back() {
        let mesh = Mesh {
            name: "square".into(),
            positions: vec![DVec3::ZERO, DVec3::X * 0.25, DVec3::ONE, DVec3::Y],
            normals: vec![DVec3::Z; 4],
            tangents: None,
            texcoords: Some(vec![[0.0, 0.25], [1.0, 0.5], [0.5, 1.0], [0.0, 0.0]]),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            parts: vec![Part {
                name: "a b".into(),
                triangles: 0..2,
            }],
            morphs: Vec::new(),
        };
        let (raw, _) = read_obj(write_obj(&mesh).as_bytes(), "square.obj", 1.0).unwrap();
        let (back, _) = Mesh::new(raw, "square.obj").unwrap();
        assert_eq!(back.triangles, mesh.triangles);
        assert_eq!(back.texcoords, mesh.texcoords);
        assert_eq!(back.parts[0].name, "a_b");
        for (found, wanted) in back.positions.iter().zip(&mesh.positions) {
            assert!(found.distance(*wanted) < 1e-6);
        }
    }
}
