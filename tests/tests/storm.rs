//! A short storm in every test run; `cargo run --release -p sinew-tests --example storm` is the
//! long one.

use sinew_tests::storm;

#[test]
fn no_random_frame_gives_a_number_that_is_not_finite() {
    for (name, run) in storm::ALL {
        println!("{name}");
        run(3_000, 7);
    }
}
