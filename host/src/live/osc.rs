//! Open Sound Control 1.0: messages and bundles in a datagram.
//!
//! Big-endian, everything padded to four bytes. Only what motion tools send is decoded: `i f s b`
//! and the types without data; other types end the reading of a message's arguments.

use super::LiveError;

/// Bundles inside bundles, at most.
const DEEPEST: usize = 4;

/// An argument of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Argument<'p> {
    /// `i`
    Int(i32),
    /// `f`
    Float(f32),
    /// `s`
    Text(&'p str),
    /// `b`
    Blob(&'p [u8]),
    /// `T`, `F`
    Truth(bool),
    /// `N`, `I`
    Nothing,
}

/// A message: what it is about, and its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Message<'p> {
    /// Begins with `/`.
    pub address: &'p str,
    /// In order.
    pub arguments: Vec<Argument<'p>>,
}

impl<'p> Message<'p> {
    /// The text at a place.
    #[must_use]
    pub fn text(&self, at: usize) -> Option<&'p str> {
        match self.arguments.get(at) {
            Some(&Argument::Text(text)) => Some(text),
            _ => None,
        }
    }

    /// The number at a place.
    #[must_use]
    pub fn number(&self, at: usize) -> Option<f32> {
        match self.arguments.get(at) {
            Some(&Argument::Float(number)) => Some(number),
            #[allow(clippy::cast_precision_loss, reason = "small counts and flags")]
            Some(&Argument::Int(number)) => Some(number as f32),
            _ => None,
        }
    }

    /// `N` numbers from a place on.
    #[must_use]
    pub fn numbers<const N: usize>(&self, at: usize) -> Option<[f32; N]> {
        let mut numbers = [0.0; N];
        for (place, number) in numbers.iter_mut().enumerate() {
            *number = self.number(at + place)?;
        }
        Some(numbers)
    }
}

/// All messages of a datagram, bundles opened. O(bytes)
///
/// # Errors
/// The first byte that is not as the protocol wants it.
pub fn messages(packet: &[u8]) -> Result<Vec<Message<'_>>, LiveError> {
    let mut found = Vec::new();
    // Parts still to be read: where they begin and end, and how deep they lie.
    let mut parts = vec![(0, packet.len(), 0)];
    while let Some((start, end, depth)) = parts.pop() {
        let mut reader = Reader {
            bytes: &packet[..end],
            at: start,
        };
        if packet[start..end].starts_with(b"#bundle\0") {
            if depth == DEEPEST {
                return Err(malformed(start, "bundles lie too deep in one another"));
            }
            reader.take(16, "a bundle's time")?;
            let first = parts.len();
            while reader.at < end {
                let at = reader.at;
                let length = i32::from_be_bytes(reader.word("a bundle's element")?);
                let length = usize::try_from(length).ok();
                let length = length.filter(|length| length % 4 == 0 && *length > 0);
                let length = length.ok_or(malformed(at, "an element of no possible length"))?;
                let inner = reader.at;
                reader.take(length, "a bundle's element")?;
                parts.push((inner, inner + length, depth + 1));
            }
            parts[first..].reverse();
        } else {
            found.push(reader.message()?);
        }
    }
    Ok(found)
}

fn malformed(at: usize, what: &'static str) -> LiveError {
    LiveError::Malformed { at, what }
}

struct Reader<'p> {
    /// Up to the end of the part that is read.
    bytes: &'p [u8],
    at: usize,
}

impl<'p> Reader<'p> {
    fn take(&mut self, length: usize, what: &'static str) -> Result<&'p [u8], LiveError> {
        let end = self.at.checked_add(length);
        let taken = end.and_then(|end| self.bytes.get(self.at..end));
        let taken = taken.ok_or(LiveError::Short { at: self.at, what })?;
        self.at += length;
        Ok(taken)
    }

    fn word(&mut self, what: &'static str) -> Result<[u8; 4], LiveError> {
        let bytes = self.take(4, what)?;
        Ok([bytes[0], bytes[1], bytes[2], bytes[3]])
    }

    fn text(&mut self, what: &'static str) -> Result<&'p str, LiveError> {
        let start = self.at;
        let rest = &self.bytes[start.min(self.bytes.len())..];
        let length = rest.iter().position(|&byte| byte == 0);
        let length = length.ok_or(LiveError::Short { at: start, what })?;
        self.take((length + 1).next_multiple_of(4), what)?;
        std::str::from_utf8(&rest[..length]).map_err(|_| malformed(start, "text that is not UTF-8"))
    }

    fn message(&mut self) -> Result<Message<'p>, LiveError> {
        let start = self.at;
        let address = self.text("an address")?;
        if !address.starts_with('/') {
            return Err(malformed(start, "neither a message nor a bundle"));
        }
        let mut arguments = Vec::new();
        // Old senders leave the types out where there are no arguments.
        if self.at < self.bytes.len() {
            let at = self.at;
            let types = self.text("the types of arguments")?;
            let types = types.strip_prefix(',');
            let types = types.ok_or(malformed(at, "types of arguments without a comma"))?;
            for kind in types.bytes() {
                arguments.push(match kind {
                    b'i' => Argument::Int(i32::from_be_bytes(self.word("an argument")?)),
                    b'f' => Argument::Float(f32::from_be_bytes(self.word("an argument")?)),
                    b's' => Argument::Text(self.text("an argument")?),
                    b'b' => {
                        let at = self.at;
                        let length = i32::from_be_bytes(self.word("an argument")?);
                        let length = usize::try_from(length);
                        let length = length.map_err(|_| malformed(at, "a negative length"))?;
                        let padded = self.take(length.next_multiple_of(4), "an argument")?;
                        Argument::Blob(&padded[..length])
                    }
                    b'T' | b'F' => Argument::Truth(kind == b'T'),
                    b'N' | b'I' => Argument::Nothing,
                    _ => break,
                });
            }
        }
        Ok(Message { address, arguments })
    }
}

/// A bundle under construction.
#[derive(Clone, Debug)]
pub struct Bundle {
    bytes: Vec<u8>,
}

impl Default for Bundle {
    fn default() -> Self {
        Self::new()
    }
}

impl Bundle {
    /// An empty bundle to be taken up at once.
    #[must_use]
    pub fn new() -> Self {
        let bytes = [&b"#bundle\0"[..], &[0, 0, 0, 0, 0, 0, 0, 1]].concat();
        Self { bytes }
    }

    /// Adds a message.
    pub fn push(&mut self, address: &str, arguments: &[Argument<'_>]) {
        let mut message = Vec::new();
        put_text(&mut message, address);
        let mut types = String::from(",");
        let mut values = Vec::new();
        for argument in arguments {
            types.push(match argument {
                Argument::Int(value) => {
                    values.extend(value.to_be_bytes());
                    'i'
                }
                Argument::Float(value) => {
                    values.extend(value.to_be_bytes());
                    'f'
                }
                Argument::Text(text) => {
                    put_text(&mut values, text);
                    's'
                }
                Argument::Blob(blob) => {
                    #[allow(clippy::cast_possible_truncation, reason = "a datagram is smaller")]
                    values.extend((blob.len() as i32).to_be_bytes());
                    values.extend_from_slice(blob);
                    values.resize(values.len().next_multiple_of(4), 0);
                    'b'
                }
                Argument::Truth(true) => 'T',
                Argument::Truth(false) => 'F',
                Argument::Nothing => 'N',
            });
        }
        put_text(&mut message, &types);
        message.extend(values);
        #[allow(clippy::cast_possible_truncation, reason = "a datagram is smaller")]
        self.bytes.extend((message.len() as i32).to_be_bytes());
        self.bytes.extend(message);
    }

    /// The datagram.
    #[must_use]
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    out.extend_from_slice(text.as_bytes());
    out.push(0);
    out.resize(out.len().next_multiple_of(4), 0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let mut bundle = Bundle::new();
        let all = [
            Argument::Int(-7),
            Argument::Float(0.5),
            Argument::Text("Hips"),
            Argument::Blob(&[1, 2, 3]),
            Argument::Truth(true),
            Argument::Nothing,
        ];
        bundle.push("/a/b", &all);
        bundle.push("/empty", &[]);
        let bytes = bundle.into_bytes();
        let found = messages(&bytes).expect("reads");
        assert_eq!(found[0].address, "/a/b");
        assert_eq!(found[0].arguments, all);
        assert_eq!(found[1].arguments, []);
        for length in 1..bytes.len() {
            // Where a message ends, what is left is whole.
            let found = messages(&bytes[..length]).map_or(0, |found| found.len());
            assert!(found < 2, "cut at {length}");
        }
    }

    #[test]
    fn bundles_in_bundles_keep_their_order_and_do_not_go_on_forever() {
        let wrap = |parts: &[&[u8]]| {
            let mut bytes = Bundle::new().into_bytes();
            for part in parts {
                bytes.extend((part.len() as i32).to_be_bytes());
                bytes.extend_from_slice(part);
            }
            bytes
        };
        let message = |name: &str| {
            let mut bytes = Vec::new();
            put_text(&mut bytes, name);
            bytes
        };
        let inner = wrap(&[&message("/2"), &message("/3")]);
        let outer = wrap(&[&message("/1"), &inner, &message("/4")]);
        let found = messages(&outer).expect("reads");
        let names: Vec<_> = found.iter().map(|message| message.address).collect();
        assert_eq!(names, ["/1", "/2", "/3", "/4"]);
        let deep = (0..9).fold(message("/x"), |inner, _| wrap(&[&inner]));
        assert!(messages(&deep).is_err());
    }
}
