//! Units of length and up axes of capture files.

use glam::{DMat3, DVec3};

/// A unit of length that capture files use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LengthUnit {
    /// 0.001 m.
    Millimetre,
    /// 0.01 m.
    Centimetre,
    /// 0.1 m.
    Decimetre,
    /// 1 m.
    Metre,
    /// 0.0254 m.
    Inch,
    /// 0.3048 m.
    Foot,
}

impl LengthUnit {
    /// Metres in one unit.
    #[must_use]
    pub fn metres(self) -> f64 {
        match self {
            Self::Millimetre => 0.001,
            Self::Centimetre => 0.01,
            Self::Decimetre => 0.1,
            Self::Metre => 1.0,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
        }
    }

    /// The usual abbreviation: `mm`, `cm`, `dm`, `m`, `in`, `ft`.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Millimetre => "mm",
            Self::Centimetre => "cm",
            Self::Decimetre => "dm",
            Self::Metre => "m",
            Self::Inch => "in",
            Self::Foot => "ft",
        }
    }

    /// Reads an abbreviation or an English name in any case, `None` where it is neither.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim().trim_end_matches('.').to_ascii_lowercase();
        let text = text.strip_suffix('s').unwrap_or(&text);
        Some(match text {
            "mm" | "millimetre" | "millimeter" => Self::Millimetre,
            "cm" | "centimetre" | "centimeter" => Self::Centimetre,
            "dm" | "decimetre" | "decimeter" => Self::Decimetre,
            "m" | "metre" | "meter" => Self::Metre,
            "in" | "inch" | "inche" | "\"" => Self::Inch,
            "ft" | "foot" | "feet" => Self::Foot,
            _ => return None,
        })
    }
}

/// The direction of the source axes that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpAxis {
    /// +X.
    PlusX,
    /// +Y.
    PlusY,
    /// +Z.
    PlusZ,
    /// -X.
    MinusX,
    /// -Y.
    MinusY,
    /// -Z.
    MinusZ,
}

impl UpAxis {
    /// The axis with this number (0 = X) and sign.
    pub(crate) fn from_index(axis: usize, positive: bool) -> Self {
        match (axis, positive) {
            (0, true) => Self::PlusX,
            (0, false) => Self::MinusX,
            (1, true) => Self::PlusY,
            (1, false) => Self::MinusY,
            (_, true) => Self::PlusZ,
            (_, false) => Self::MinusZ,
        }
    }

    /// Reads `Z`, `+Z`, `-y` and the like.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let (positive, letter) = match text.strip_prefix('-') {
            Some(rest) => (false, rest),
            None => (true, text.strip_prefix('+').unwrap_or(text)),
        };
        let axis = match letter {
            "x" | "X" => 0,
            "y" | "Y" => 1,
            "z" | "Z" => 2,
            _ => return None,
        };
        Some(Self::from_index(axis, positive))
    }

    /// `+X` to `-Z`.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::PlusX => "+X",
            Self::PlusY => "+Y",
            Self::PlusZ => "+Z",
            Self::MinusX => "-X",
            Self::MinusY => "-Y",
            Self::MinusZ => "-Z",
        }
    }

    /// The rotation that turns source axes into axes with Y up.
    ///
    /// Each is a quarter or half turn, so that no coordinate is rounded.
    #[must_use]
    pub fn to_y_up(self) -> DMat3 {
        let rows = match self {
            Self::PlusX => [DVec3::NEG_Y, DVec3::X, DVec3::Z],
            Self::PlusY => [DVec3::X, DVec3::Y, DVec3::Z],
            Self::PlusZ => [DVec3::X, DVec3::Z, DVec3::NEG_Y],
            Self::MinusX => [DVec3::Y, DVec3::NEG_X, DVec3::Z],
            Self::MinusY => [DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z],
            Self::MinusZ => [DVec3::X, DVec3::NEG_Z, DVec3::Y],
        };
        DMat3::from_cols(rows[0], rows[1], rows[2]).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_up_axis_turns_to_y_without_mirroring() {
        for text in ["X", "+y", "Z", "-X", "-Y", "-z"] {
            let up = UpAxis::parse(text).unwrap();
            let mut source = DVec3::ZERO;
            let axis = "XYZ".find(&up.symbol()[1..]).unwrap();
            source[axis] = if up.symbol().starts_with('-') {
                -1.0
            } else {
                1.0
            };
            let turn = up.to_y_up();
            assert_eq!(turn * source, DVec3::Y, "{text}");
            assert_eq!(turn.determinant(), 1.0, "{text}");
        }
        // The usual case: the floor's X stays, what was forward (Y) becomes backward Z.
        assert_eq!(
            UpAxis::PlusZ.to_y_up() * DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(1.0, 3.0, -2.0)
        );
        assert_eq!(UpAxis::parse("W"), None);
    }

    #[test]
    fn units_are_read_by_symbol_and_by_name() {
        for (text, metres) in [
            ("mm", 0.001),
            (" MM. ", 0.001),
            ("Millimeters", 0.001),
            ("m", 1.0),
            ("Meters", 1.0),
            ("inches", 0.0254),
            ("feet", 0.3048),
        ] {
            assert_eq!(LengthUnit::parse(text).unwrap().metres(), metres, "{text}");
        }
        assert_eq!(LengthUnit::parse("V"), None);
        assert_eq!(LengthUnit::parse(""), None);
    }
}
