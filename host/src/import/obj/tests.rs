use glam::DVec3;

use super::*;

const QUAD: &str = "# a quad and a triangle
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 2 0 0
vt 0 0
vt 1 0
vt 1 1
vt 0 0.25
vn 0 0 2
f 1/1/1 2/2/1 3/3/1 4/4/1
g side
f 2//1 5//1 3//1
";

fn read(text: &str) -> (RawMesh, Vec<Notice>) {
    read_obj(text.as_bytes(), "dir/quad.obj", 1.0).expect("a good file")
}

fn fault(text: &str) -> ImportError {
    read_obj(text.as_bytes(), "quad.obj", 1.0).expect_err("a bad file")
}

fn says(notices: &[Notice], words: &str) -> bool {
    notices.iter().any(|notice| notice.text.contains(words))
}

fn part_names(mesh: &RawMesh) -> Vec<&str> {
    mesh.primitives.iter().map(|p| p.name.as_str()).collect()
}

#[test]
fn reads_polygons_groups_and_attributes() {
    let (mesh, notices) = read_obj(QUAD.as_bytes(), "dir/quad.obj", 0.1).expect("a good file");
    assert_eq!(notices, []);
    assert_eq!(mesh.name, "quad");
    assert_eq!(mesh.positions.len(), 5);
    assert_eq!(mesh.positions[4], DVec3::new(0.2, 0.0, 0.0));
    assert_eq!(mesh.normals, Some(vec![DVec3::Z; 5]));
    let texcoords = mesh.texcoords.as_deref().expect("texture coordinates");
    assert_eq!(
        texcoords[..4],
        [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.75]]
    );
    assert_eq!(part_names(&mesh), ["default", "side"]);
    assert_eq!(mesh.primitives[0].corners, [0, 1, 2, 3]);
    assert_eq!(mesh.primitives[0].polygon_sizes, [4]);
    assert_eq!(mesh.primitives[1].corners, [1, 4, 2]);
}

#[test]
fn every_corner_form_and_negative_indices_mean_the_same() {
    let (expected, _) = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1 2 3");
    for face in [
        "1// 2// 3//",
        "-3 -2 -1",
        "1/1 2/1 3/-1",
        "1/1/ 2/1/ 3/1/",
        "1//1 -2//-1 3//1",
    ] {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf {face} # end\nv 9 9 9");
        let (mesh, _) = read(&text);
        assert_eq!(mesh.primitives, expected.primitives, "{face}");
        assert_eq!(mesh.normals.is_some(), face.ends_with("//1"), "{face}");
        assert_eq!(
            mesh.texcoords.is_some(),
            face.contains("/1") && !face.contains("//"),
            "{face}"
        );
    }
    // A positive index may refer to a later line.
    let (mesh, _) = read("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0");
    assert_eq!(mesh.primitives, expected.primitives);
}

#[test]
fn line_ends_continuations_and_a_byte_order_mark_do_not_matter() {
    let expected = read(QUAD);
    let crlf = QUAD.replace('\n', "\r\n");
    let continued = QUAD
        .replace("v 0 0 0", "  v \\\n 0 \\ \r\n 0 0")
        .replace("4/4/1", "\\\n4/4/1");
    let comment = QUAD.replace("triangle", "C:\\");
    let marked = format!("\u{FEFF}{}", QUAD.replace(' ', "\t"));
    let open = QUAD.trim_end().to_owned();
    for text in [crlf, continued, comment, marked, open] {
        assert_eq!(read(&text), expected, "{text}");
    }
    let error = fault(&QUAD.replace("v 1 1 0", "v 1 \\\n 1 \\\n x"));
    assert_eq!(error.place, Place::Line(4));
}

#[test]
fn parts_are_named_by_group_then_object_then_material() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let (mesh, notices) = read(&format!(
        "{vertices}usemtl skin \nf 1 2 3\no Left Arm\nf 1 2 3\ng a  b\nf 1 2 3\ng empty\ng c\n\
         f 1 2 3\ng a b\nusemtl x\nf 3 2 1\ng\nf 1 2 3\n"
    ));
    assert_eq!(part_names(&mesh), ["skin", "Left Arm", "a b", "c"]);
    assert_eq!(mesh.name, "Left Arm");
    assert_eq!(mesh.primitives[1].polygon_sizes, [3, 3]);
    assert_eq!(mesh.primitives[2].corners, [0, 1, 2, 2, 1, 0]);
    assert!(says(
        &notices,
        "1 groups have no face and are dropped, such as \"empty\""
    ));
    let bytes = [vertices.as_bytes(), b"g H\xFCfte\nf 1 2 3"].concat();
    let (mesh, notices) = read_obj(&bytes, "x", 1.0).expect("a good file");
    assert_eq!(part_names(&mesh), ["H\u{FFFD}fte"]);
    assert!(says(&notices, "not UTF-8"));
}

#[test]
fn vertices_stay_one_where_corners_differ() {
    // Two triangles meet at a right angle along vertices 1 and 2, each with its own normal.
    let (mesh, notices) = read(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nvn 0 1 0\nvt 0 0\nvt 0.5 0\n\
         f 1/1/1 2/1/1 3/1/1\nf 1/2/2 4/1/2 2/1/2",
    );
    assert_eq!(mesh.positions.len(), 4);
    let normals = mesh.normals.expect("normals");
    // Equal corner angles at vertex 1 (90 degrees each) and 2 (45 each): the plain mean.
    let mean = DVec3::new(0.0, 1.0, 1.0).normalize();
    assert!(normals[0].abs_diff_eq(mean, 1e-12), "{}", normals[0]);
    assert!(normals[1].abs_diff_eq(mean, 1e-12), "{}", normals[1]);
    assert_eq!(normals[2], DVec3::Z);
    assert_eq!(normals[3], DVec3::Y);
    assert!(says(
        &notices,
        "2 vertices have corners with different normals"
    ));
    assert_eq!(mesh.texcoords.expect("texture coordinates")[0], [0.0, 1.0]);
    assert!(says(
        &notices,
        "1 vertices have several texture coordinates"
    ));
}

#[test]
fn normals_are_weighted_by_corner_angle() {
    // At vertex 1 the first face has an angle of 90 degrees, the second one of 45.
    let (mesh, _) = read(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 1\nvn 0 0 1\nvn 1 0 0\nf 1//1 2//1 3//1\nf 1//2 4//2 2//2",
    );
    let expected = DVec3::new(1.0, 0.0, 2.0).normalize();
    let normal = mesh.normals.expect("normals")[0];
    assert!(normal.abs_diff_eq(expected, 1e-12), "{normal}");
}

#[test]
fn missing_normals_come_from_the_face() {
    let (mesh, notices) =
        read("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nvn 0 0 0\nvn 0 0 1\nf 1//1 2 3//2");
    // The face lies in the plane of X and Y; vertex 4 belongs to none.
    assert_eq!(
        mesh.normals,
        Some(vec![DVec3::Z, DVec3::Z, DVec3::Z, DVec3::Y])
    );
    assert!(says(&notices, "2 corners have none"));
    // Opposite normals have no mean.
    let (mesh, _) =
        read("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvn 0 0 -1\nf 1//1 2//1 3//1\nf 1//2 3//2 2//2");
    assert_eq!(mesh.normals, Some(vec![DVec3::Z; 3]));
}

#[test]
fn references_to_tables_that_are_absent_are_ignored() {
    let (mesh, notices) = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/7/8 2/1/1 3/2/2");
    assert_eq!((mesh.texcoords, mesh.normals), (None, None));
    assert!(says(
        &notices,
        "refer to texture coordinates, of which the file has none"
    ));
    assert!(says(
        &notices,
        "refer to normals, of which the file has none"
    ));
}

#[test]
fn other_elements_are_skipped_and_named_once() {
    let extra = "l 1 2\nl 2 3\np 1\ncurv 0 1 1 2\ns off\nmtllib a.mtl\nxyz 1\nvt 1\n";
    let (mesh, notices) = read(&format!(
        "{extra}{}",
        QUAD.replace("v 0 1 0", "v 0 1 0 1 0.5 0.5")
    ));
    assert_eq!(mesh.primitives.len(), 2);
    let texts: Vec<_> = notices.iter().map(|notice| notice.text.as_str()).collect();
    assert_eq!(
        texts,
        [
            "1 \"curv\" statements are no polygons and are skipped",
            "2 \"l\" statements are no polygons and are skipped",
            "1 \"p\" statements are no polygons and are skipped",
            "1 lines with unknown keywords, such as \"xyz\", are skipped",
            "vertices have weights or colours, which are not kept",
        ]
    );
}

#[test]
fn bad_files_are_refused_with_their_line() {
    let cases = [
        ("f 1/1/1", "f 0/1/1", 12, "vertex 0 does not exist"),
        (
            "f 1/1/1",
            "f 6/1/1",
            12,
            "vertex 6 does not exist: there are 5",
        ),
        ("f 1/1/1", "f -6/1/1", 12, "vertex -6 does not exist"),
        ("f 1/1/1", "f 1/5/1", 12, "texture coordinate 5"),
        ("f 1/1/1", "f 1/1/2", 12, "normal 2"),
        ("f 1/1/1", "f 4294967297", 12, "vertex 4294967297"),
        ("f 1/1/1", "f 99999999999999999999", 12, "not a number"),
        ("f 1/1/1", "f 1/1/1/1", 12, "not a number"),
        ("f 1/1/1", "f /1/1", 12, "not a number"),
        ("f 1/1/1", "f 1.5", 12, "not a number"),
        (
            "2//1 5//1 3//1",
            "2//1 5//1",
            14,
            "is 2, which must be at least 3",
        ),
        ("2//1 5//1 3//1", "", 14, "is 0, which must be at least 3"),
        (
            "v 1 1 0",
            "v 1 nan 0",
            4,
            "value 2 of a vertex is not finite",
        ),
        ("v 1 1 0", "v 1 1e999 0", 4, "not finite"),
        ("v 1 1 0", "v 1 1", 4, "value 3 of a vertex is missing"),
        ("v 1 1 0", "v 1,0 1,0 0", 4, "not a comma"),
        ("vn 0 0 2", "vn 0 inf 2", 11, "value 2 of a normal"),
        ("vt 0 0\n", "vt\n", 7, "value 1 of a texture coordinate"),
        ("g side", "\u{1}\u{2}", 13, "not an OBJ file"),
    ];
    for (old, new, line, words) in cases {
        let error = fault(&QUAD.replacen(old, new, 1));
        assert!(error.to_string().contains(words), "{new:?}: {error}");
        assert_eq!(error.place, Place::Line(line), "{new:?}: {error}");
    }
}

#[test]
fn files_without_a_mesh_are_refused() {
    assert_eq!(fault("").kind, ImportErrorKind::Empty);
    assert!(matches!(
        fault("# nothing").kind,
        ImportErrorKind::Missing { .. }
    ));
    assert!(matches!(
        fault("v 0 0 0").kind,
        ImportErrorKind::Missing { .. }
    ));
    let prose = fault("\nOnce upon a time\n");
    assert!(matches!(prose.kind, ImportErrorKind::NotThisFormat { .. }));
    assert_eq!(prose.place, Place::Line(2));
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = read_obj(QUAD.as_bytes(), "x", unit).expect_err("no unit");
        assert!(matches!(error.kind, ImportErrorKind::OutOfRange { .. }));
    }
}

#[test]
fn cut_and_damaged_files_never_panic() {
    for length in 0..QUAD.len() {
        let cut = read_obj(&QUAD.as_bytes()[..length], "x", 1.0);
        // Without the first three corners of a face there is no mesh.
        assert!(
            cut.is_err() || length > QUAD.find("3/3").expect("there"),
            "{length}"
        );
    }
    let mut random = crate::import::text::tests::Random(11);
    let mut survived = 0;
    for _ in 0..2000 {
        let mut bytes = QUAD.as_bytes().to_vec();
        for _ in 0..=random.below(3) {
            let at = random.below(bytes.len());
            bytes[at] ^= 1 << random.below(8);
        }
        if let Ok((mesh, _)) = read_obj(&bytes, "x", 1.0) {
            survived += 1;
            for part in &mesh.primitives {
                let sizes: usize = part.polygon_sizes.iter().map(|size| *size as usize).sum();
                assert_eq!(sizes, part.corners.len());
                assert!(
                    part.corners
                        .iter()
                        .all(|c| (*c as usize) < mesh.positions.len())
                );
            }
            let normals = mesh.normals.iter().flatten();
            assert!(normals.clone().all(|normal| normal.is_normalized()));
        }
    }
    assert!((1..2000).contains(&survived), "{survived}");
}
