use glam::DVec3;

use super::limbs::bend;
use super::trunk::at_height;

#[test]
fn a_bend_is_found_where_the_limb_bends() {
    let elbow = DVec3::new(0.33, 0.0, 0.0);
    let mut axis: Vec<DVec3> = (0..33).map(|k| DVec3::X * 0.01 * f64::from(k)).collect();
    axis.extend((0..30).map(|k| elbow + DVec3::new(0.6, 0.8, 0.0) * 0.01 * f64::from(k)));
    // Half is expected, the bend says otherwise.
    assert!(bend(&axis, 0.45).distance(elbow) < 0.015);
    // A straight limb does as expected.
    let straight: Vec<DVec3> = (0..=60).map(|k| DVec3::X * 0.01 * f64::from(k)).collect();
    assert!(bend(&straight, 0.45).distance(DVec3::X * 0.27) < 0.011);
    assert_eq!(bend(&[], 0.5), DVec3::ZERO);
    assert_eq!(bend(&[DVec3::X], 0.5), DVec3::X);
}

#[test]
fn lines_are_read_between_their_places() {
    let line = [DVec3::new(1.0, 0.0, 0.0), DVec3::new(3.0, 2.0, 0.0)];
    assert_eq!(at_height(&line, 1.0), DVec3::new(2.0, 1.0, 0.0));
    assert_eq!(at_height(&line, 5.0), DVec3::new(3.0, 5.0, 0.0));
    assert_eq!(at_height(&[], 5.0), DVec3::Y * 5.0);
}
