//! Cuts the bundled body, in T-pose, into fifteen rigid groups of an OBJ.
//!
//!     cargo run --release -p sinew-tests --example cut -- cut.obj

use std::fs;

use glam::DVec3;
use sinew_host::export::obj::write_obj;
use sinew_tests::cut::{cut, with_arms};
use sinew_tests::human;

fn main() {
    let path = std::env::args().nth(1).unwrap_or_else(|| "cut.obj".into());
    let mesh = cut(&with_arms(&human::body(), DVec3::X));
    fs::write(&path, write_obj(&mesh)).expect("writes");
    println!(
        "{} groups, {} triangles: {path}",
        mesh.parts.len(),
        mesh.triangles.len()
    );
}
