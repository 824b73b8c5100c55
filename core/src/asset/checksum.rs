//! CRC-32 (IEEE 802.3), the one of zlib and PNG, so that any tool can check an asset.

/// Four bytes a step; the tables take 4 KiB.
const TABLES: [[u32; 256]; 4] = {
    let mut tables = [[0; 256]; 4];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 == 1 {
                (crc >> 1) ^ 0xEDB8_8320
            } else {
                crc >> 1
            };
            bit += 1;
        }
        tables[0][byte] = crc;
        byte += 1;
    }
    let mut table = 1;
    while table < 4 {
        byte = 0;
        while byte < 256 {
            let before = tables[table - 1][byte];
            tables[table][byte] = (before >> 8) ^ tables[0][(before & 0xFF) as usize];
            byte += 1;
        }
        table += 1;
    }
    tables
};

/// Checksum of `bytes`. O(bytes). It finds every change confined to 32 consecutive bits.
#[must_use]
pub fn crc32(bytes: &[u8]) -> u32 {
    let at = |table: usize, crc: u32, shift: u32| TABLES[table][((crc >> shift) & 0xFF) as usize];
    let mut crc = u32::MAX;
    let (words, rest) = bytes.as_chunks::<4>();
    for &word in words {
        crc ^= u32::from_le_bytes(word);
        crc = at(3, crc, 0) ^ at(2, crc, 8) ^ at(1, crc, 16) ^ at(0, crc, 24);
    }
    for &byte in rest {
        crc = (crc >> 8) ^ at(0, crc ^ u32::from(byte), 0);
    }
    !crc
}

#[cfg(test)]
mod tests {
    use super::crc32;

    #[test]
    fn known_values() {
        assert_eq!(crc32(b""), 0);
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }
}
