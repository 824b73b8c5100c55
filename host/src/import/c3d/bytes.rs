//! The three ways in which C3D files store numbers.

/// Byte order and number format, from byte 4 of the parameter section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    /// Little-endian, IEEE 754 (84).
    Intel,
    /// Little-endian integers, VAX F reals (85).
    Dec,
    /// Big-endian, IEEE 754 (86).
    Sgi,
}

impl ByteOrder {
    pub(super) const ALL: [Self; 3] = [Self::Intel, Self::Dec, Self::Sgi];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Intel => "Intel",
            Self::Dec => "DEC",
            Self::Sgi => "SGI/MIPS",
        }
    }

    pub(super) fn word(self, bytes: [u8; 2]) -> u16 {
        match self {
            Self::Intel | Self::Dec => u16::from_le_bytes(bytes),
            Self::Sgi => u16::from_be_bytes(bytes),
        }
    }

    pub(super) fn integer(self, bytes: [u8; 2]) -> i16 {
        self.word(bytes) as i16
    }

    /// A real number; the reserved VAX operand becomes NaN.
    pub(super) fn real(self, bytes: [u8; 4]) -> f64 {
        match self {
            Self::Intel => f64::from(f32::from_le_bytes(bytes)),
            Self::Sgi => f64::from(f32::from_be_bytes(bytes)),
            Self::Dec => vax_f(bytes),
        }
    }

    /// Four bytes as the bit pattern of a real, most significant bit first.
    pub(super) fn real_bits(self, bytes: [u8; 4]) -> u32 {
        match self {
            Self::Intel => u32::from_le_bytes(bytes),
            Self::Sgi => u32::from_be_bytes(bytes),
            Self::Dec => vax_bits(bytes),
        }
    }
}

/// VAX F swaps its two 16-bit words.
fn vax_bits([a, b, c, d]: [u8; 4]) -> u32 {
    u32::from_be_bytes([b, a, d, c])
}

/// VAX F floating: sign, exponent in excess of 128, fraction 0.1f with a hidden first bit
/// (VAX Architecture Reference Manual, chapter 2).
fn vax_f(bytes: [u8; 4]) -> f64 {
    let bits = vax_bits(bytes);
    let negative = bits >> 31 == 1;
    let exponent = (bits >> 23 & 0xff) as i32;
    if exponent == 0 {
        return if negative { f64::NAN } else { 0.0 };
    }
    let fraction = f64::from(bits & 0x7f_ffff | 0x80_0000);
    // The fraction counts units of 2^-24; both steps are exact in f64.
    let size = fraction * 2f64.powi(exponent - 128 - 24);
    if negative { -size } else { size }
}

/// The file, and where its first block begins.
#[derive(Clone, Copy)]
pub(super) struct Bytes<'a> {
    /// From the header on.
    pub data: &'a [u8],
    /// Bytes before the header, for messages.
    pub skipped: usize,
}

impl<'a> Bytes<'a> {
    /// `N` bytes at `offset`, `None` past the end.
    pub(super) fn array<const N: usize>(&self, offset: usize) -> Option<[u8; N]> {
        self.data.get(offset..)?.first_chunk::<N>().copied()
    }

    /// Up to `len` bytes at `offset`, fewer at the end of the file.
    pub(super) fn up_to(&self, offset: usize, len: usize) -> &'a [u8] {
        let start = offset.min(self.data.len());
        let end = offset.saturating_add(len).min(self.data.len());
        &self.data[start..end]
    }

    /// `offset` as counted from the file's first byte.
    pub(super) fn place(&self, offset: usize) -> super::Place {
        super::Place::Byte((self.skipped + offset) as u64)
    }
}

/// Text without padding: up to the first NUL, trailing blanks removed, UTF-8 or else Latin-1.
pub(super) fn text(bytes: &[u8]) -> String {
    let end = bytes
        .iter()
        .position(|byte| *byte == 0)
        .unwrap_or(bytes.len());
    let bytes = bytes[..end].trim_ascii();
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_value_in_three_encodings() {
        // 50 = 1.5625 x 2^5: IEEE 0x42480000; VAX 0.78125 x 2^6: exponent 134, words 4348 0000.
        assert_eq!(ByteOrder::Intel.real([0x00, 0x00, 0x48, 0x42]), 50.0);
        assert_eq!(ByteOrder::Sgi.real([0x42, 0x48, 0x00, 0x00]), 50.0);
        assert_eq!(ByteOrder::Dec.real([0x48, 0x43, 0x00, 0x00]), 50.0);
        assert_eq!(ByteOrder::Dec.real([0x80, 0xc0, 0x00, 0x00]), -1.0);
        assert_eq!(ByteOrder::Dec.integer([0xfe, 0xff]), -2);
        assert_eq!(ByteOrder::Sgi.integer([0xff, 0xfe]), -2);
    }

    #[test]
    fn vax_extremes_are_finite_and_the_reserved_operand_is_not_a_number() {
        assert_eq!(ByteOrder::Dec.real([0; 4]), 0.0);
        assert!(ByteOrder::Dec.real([0x00, 0x80, 0x00, 0x00]).is_nan());
        // Largest: (1 - 2^-24) x 2^127.
        let largest = ByteOrder::Dec.real([0xff, 0x7f, 0xff, 0xff]);
        assert_eq!(largest, (1.0 - 2f64.powi(-24)) * 2f64.powi(127));
    }

    #[test]
    fn padding_goes_and_foreign_letters_stay() {
        assert_eq!(text(b"LASI    "), "LASI");
        assert_eq!(text(b"mm\0\0"), "mm");
        assert_eq!(text(b"Knie\xe4u\xdfen "), "Knieäußen");
        assert_eq!(text("膝  ".as_bytes()), "膝");
        assert_eq!(text(b"\0garbage"), "");
    }
}
