use super::super::text::tests::Random;
use super::*;

const TEXT: &str = "ply\r\nformat ascii 1.0\r\ncomment scanned\r\nelement vertex 4\r\n\
property float x\r\nproperty float y\r\nproperty float z\r\nproperty uchar red\r\n\
element face 2\r\nproperty list uchar int vertex_indices\r\nelement edge 1\r\n\
property int vertex1\r\nend_header\r\n0 0 0 255\r\n1000 0 0 1\r\n1000 1000 0 2\r\n0 1000 0.5 3\r\n\
4 0 1 2 3\r\n2 0 1\r\n7\r\n";

/// Four vertices with normals, a triangle and a quad, in either byte order.
fn binary(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty double x\n\
         property float y\nproperty short z\nproperty float nx\nproperty float ny\n\
         property float nz\nelement face 2\nproperty uchar flags\n\
         property list ushort uint vertex_index\nend_header\n"
    )
    .into_bytes();
    fn put<const N: usize>(bytes: &mut Vec<u8>, big: bool, mut little: [u8; N]) {
        if big {
            little.reverse();
        }
        bytes.extend(little);
    }
    for (x, y, z) in [(0.0, 0.0, 0), (1.5, 0.0, -3), (1.0, 2.0, 0), (0.0, 1.0, 7)] {
        put(&mut bytes, big, f64::to_le_bytes(x));
        put(&mut bytes, big, f32::to_le_bytes(y));
        put(&mut bytes, big, i16::to_le_bytes(z));
        for n in [0.0, 0.0, 2.0] {
            put(&mut bytes, big, f32::to_le_bytes(n));
        }
    }
    for face in [&[0_u32, 1, 2][..], &[0, 1, 2, 3]] {
        bytes.push(9);
        put(&mut bytes, big, (face.len() as u16).to_le_bytes());
        for index in face {
            put(&mut bytes, big, index.to_le_bytes());
        }
    }
    bytes
}

#[test]
fn text_is_read_in_its_unit_and_short_faces_are_left_out() {
    let (mesh, notices) = read_ply(TEXT.as_bytes(), "scan.ply", 0.001).expect("reads");
    assert_eq!(mesh.name, "scan");
    assert_eq!(mesh.positions[1], DVec3::X);
    assert_eq!(mesh.positions[3], DVec3::new(0.0, 1.0, 0.0005));
    assert_eq!(mesh.primitives[0].corners, [0, 1, 2, 3]);
    assert_eq!(mesh.primitives[0].polygon_sizes, [4]);
    assert_eq!(notices.len(), 1);
    assert!(notices[0].text.contains("1 of 2 faces"));
}

#[test]
fn both_byte_orders_say_the_same() {
    let (little, notices) = read_ply(&binary(false), "a.ply", 1.0).expect("reads");
    let (big, _) = read_ply(&binary(true), "a.ply", 1.0).expect("reads");
    assert_eq!(little, big);
    assert!(notices.is_empty());
    assert_eq!(little.positions[1], DVec3::new(1.5, 0.0, -3.0));
    assert_eq!(little.normals.as_deref(), Some(&[DVec3::Z; 4][..]));
    assert_eq!(little.primitives[0].polygon_sizes, [3, 4]);
}

#[test]
fn faults_are_named_with_their_place() {
    let error = |text: &str| {
        read_ply(text.as_bytes(), "a.ply", 1.0)
            .expect_err("refused")
            .to_string()
    };
    assert!(error("").contains("empty"));
    assert!(error("solid cube").contains("not a PLY file"));
    assert!(error("ply\nformat ascii 1.0\n").contains("end_header"));
    let change = |from: &str, to: &str| error(&TEXT.replace(from, to));
    assert!(change("ascii", "utf").starts_with("a.ply:2: format"));
    assert!(change("element vertex 4", "element vertex 4000000000").contains("a.ply:4: "));
    assert!(change("element vertex 4", "element vertex -4").contains("not a number"));
    assert!(change("float z", "float w").contains("x, y or z"));
    assert!(change("float z", "quad z").contains("property type"));
    assert!(change("1000 0 0 1", "1000 nan 0 1").contains("not finite"));
    assert!(change("1000 0 0 1", "1000 0").contains("value of z is missing"));
    assert!(change("4 0 1 2 3", "4 0 1 2 9").contains("vertex 9 does not exist"));
    assert!(change("4 0 1 2 3", "4000000 0 1").contains("length of a list"));
    assert!(change("element face 2", "element point 2").contains("point cloud"));
    let (text, _) = TEXT.split_at(TEXT.len() - 10);
    assert!(error(text).contains("ends inside"), "{}", error(text));
}

#[test]
fn damage_never_panics() {
    let mut random = Random(7);
    for sample in [TEXT.as_bytes().to_vec(), binary(false), binary(true)] {
        for length in 0..sample.len() {
            let _ = read_ply(&sample[..length], "cut", 1.0);
        }
        for _ in 0..3000 {
            let mut damaged = sample.clone();
            for _ in 0..=random.below(3) {
                let at = random.below(damaged.len());
                damaged[at] = random.below(256) as u8;
            }
            let _ = read_ply(&damaged, "damaged", 1.0);
        }
    }
}
