//! A picture as a PNG file on the emulating machine, through semihosting: nothing is compressed and
//! a row at a time is in memory.

use cortex_m_semihosting::{nr, syscall};

/// Rows of up to this many pixels.
const WIDEST: usize = 480;

/// Writes `width x height` pixels, red, green and blue of each from `pixel(x, y)`.
///
/// # Errors
/// Why the file is not whole.
pub fn write(
    path: &str,
    width: usize,
    height: usize,
    pixel: impl Fn(usize, usize) -> [u8; 3],
) -> Result<(), &'static str> {
    let mut name = [0; 256];
    let room = name.get_mut(..path.len()).ok_or("the path is too long")?;
    room.copy_from_slice(path.as_bytes());
    let mut row = [0; 1 + 3 * WIDEST];
    let row = row
        .get_mut(..1 + 3 * width)
        .ok_or("the picture is too wide")?;
    // SAFETY: the arguments are those that the call asks for: a name that ends in zero, the mode
    // "wb", the name's length.
    let handle = unsafe { syscall!(OPEN, name.as_ptr(), nr::open::W_TRUNC_BINARY, path.len()) };
    if handle == usize::MAX {
        return Err("the picture's file cannot be written");
    }
    let mut file = File { handle, crc: !0 };
    file.raw(b"\x89PNG\r\n\x1a\n")?;
    file.start(13, b"IHDR")?;
    file.part(&(width as u32).to_be_bytes())?;
    file.part(&(height as u32).to_be_bytes())?;
    file.part(&[8, 2, 0, 0, 0])?;
    file.end()?;
    // A row is a stored block of five bytes and its pixels after a filter of none.
    let stored = row.len() as u16;
    file.start((2 + height * (5 + row.len()) + 4) as u32, b"IDAT")?;
    file.part(&[0x78, 0x01])?;
    let (mut a, mut b) = (1_u32, 0_u32);
    for y in 0..height {
        let (_, pixels) = row.split_at_mut(1);
        for (x, place) in pixels.as_chunks_mut().0.iter_mut().enumerate() {
            *place = pixel(x, y);
        }
        for &byte in row.iter() {
            a = (a + u32::from(byte)) % 65_521;
            b = (b + a) % 65_521;
        }
        file.part(&[u8::from(y + 1 == height)])?;
        file.part(&stored.to_le_bytes())?;
        file.part(&(!stored).to_le_bytes())?;
        file.part(row)?;
    }
    file.part(&(b << 16 | a).to_be_bytes())?;
    file.end()?;
    file.start(0, b"IEND")?;
    file.end()?;
    // SAFETY: the handle is open.
    match unsafe { syscall!(CLOSE, file.handle) } {
        0 => Ok(()),
        _ => Err("the picture's file is not whole"),
    }
}

/// An open file and the checksum of the chunk being written.
struct File {
    handle: usize,
    crc: u32,
}

impl File {
    fn raw(&mut self, bytes: &[u8]) -> Result<(), &'static str> {
        // SAFETY: the handle is open, the bytes are alive; what is left unwritten comes back.
        match unsafe { syscall!(WRITE, self.handle, bytes.as_ptr(), bytes.len()) } {
            0 => Ok(()),
            _ => Err("the picture's file is not whole"),
        }
    }

    fn part(&mut self, bytes: &[u8]) -> Result<(), &'static str> {
        for &byte in bytes {
            self.crc ^= u32::from(byte);
            for _ in 0..8 {
                self.crc = self.crc >> 1 ^ (0xEDB8_8320 & (self.crc & 1).wrapping_neg());
            }
        }
        self.raw(bytes)
    }

    fn start(&mut self, length: u32, kind: &[u8; 4]) -> Result<(), &'static str> {
        self.raw(&length.to_be_bytes())?;
        self.crc = !0;
        self.part(kind)
    }

    fn end(&mut self) -> Result<(), &'static str> {
        let crc = !self.crc;
        self.raw(&crc.to_be_bytes())
    }
}
