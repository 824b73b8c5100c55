//! Directions as two 16-bit numbers (Meyer, Süßmuth, Sußner, Stamminger and Greiner, *On
//! Floating-Point Normal Vectors*, 2010): the octahedron `|x| + |y| + |z| = 1`, its lower half
//! folded out over the corners of the upper.

use super::lanes::Lanes;
use crate::asset::LANES;

/// What stands for one.
const ONE: f32 = i16::MAX as f32;

/// Directions of some length from 18,918 to 32,767. Every number on the way is whole and below
/// 2^24, so all ways of computing it agree to the bit.
#[inline(always)]
pub(super) fn unpack<L: Lanes>(
    token: L::Token,
    [x, y]: &[[i16; LANES]; 2],
    first: usize,
) -> [L; 3] {
    let (x, y) = (
        L::load_signed(token, x, first),
        L::load_signed(token, y, first),
    );
    let z = L::splat(token, ONE).sub(x.magnitude()).sub(y.magnitude());
    // How far beyond the edge of the upper half, never more than either number: so a number
    // between these two limits is that far with its own sign.
    let low = z.smaller(L::splat(token, 0.0));
    let high = L::splat(token, 0.0).sub(low);
    [
        x.sub(x.smaller(high).larger(low)),
        y.sub(y.smaller(high).larger(low)),
        z,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_and_corners_come_back() {
        let x: [i16; LANES] = [i16::MAX, 0, 0, i16::MAX, -i16::MAX, 0, 0, 0];
        let y: [i16; LANES] = [0, i16::MIN + 1, 0, i16::MAX, i16::MAX, 0, 0, 0];
        let unpacked = |lane| unpack::<f32>((), &[x, y], lane).map(|number| number / ONE);
        assert_eq!(unpacked(0), [1.0, 0.0, 0.0]);
        assert_eq!(unpacked(1), [0.0, -1.0, 0.0]);
        assert_eq!(unpacked(2), [0.0, 0.0, 1.0]);
        assert_eq!(unpacked(3), [0.0, 0.0, -1.0]);
        assert_eq!(unpacked(4), [0.0, 0.0, -1.0]);
    }
}
