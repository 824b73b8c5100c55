//! Words and names of the hierarchy, with their lines.

use crate::import::text::{is_space, trim};

/// A place in the text that knows its line.
pub(super) struct Cursor<'a> {
    /// Not yet read.
    pub rest: &'a [u8],
    /// Line of the byte before `rest`.
    pub line: usize,
}

impl<'a> Cursor<'a> {
    pub fn new(text: &'a [u8]) -> Self {
        Self {
            rest: text,
            line: 1,
        }
    }

    fn skip_space(&mut self) {
        while let [first, tail @ ..] = self.rest
            && is_space(*first)
        {
            // The CR of a CR LF pair is left to its LF.
            let ends = *first == b'\n' || (*first == b'\r' && !tail.starts_with(b"\n"));
            self.line += usize::from(ends);
            self.rest = tail;
        }
    }

    fn take(&mut self, count: usize) -> &'a [u8] {
        let (taken, rest) = self.rest.split_at(count);
        self.rest = rest;
        taken
    }

    /// The next word, on this line or a later one; a brace is a word of its own.
    pub fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_space();
        let ends = |byte: &u8| is_space(*byte) || matches!(byte, b'{' | b'}');
        let length = match self.rest.iter().position(ends) {
            Some(0) => 1,
            Some(length) => length,
            None => self.rest.len(),
        };
        (length > 0).then(|| self.take(length))
    }

    /// The rest of this line up to an opening brace: a name, which may hold spaces.
    pub fn name(&mut self) -> &'a [u8] {
        let ends = |byte: &u8| matches!(byte, b'{' | b'\n' | b'\r');
        let length = self.rest.iter().position(ends);
        trim(self.take(length.unwrap_or(self.rest.len())))
    }
}
