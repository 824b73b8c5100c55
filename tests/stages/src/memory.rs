//! One piece of memory, handed out in parts.

use crate::Fault;

/// Memory that is left.
#[derive(Debug)]
pub struct Memory<'m> {
    left: &'m mut [f32],
}

impl<'m> Memory<'m> {
    /// All of `numbers`; old contents do not matter.
    pub fn new(numbers: &'m mut [f32]) -> Self {
        Self { left: numbers }
    }

    /// Numbers that are left.
    #[must_use]
    pub fn left(&self) -> usize {
        self.left.len()
    }

    /// The next `length` numbers, zero.
    ///
    /// # Errors
    /// [`Fault::Memory`] where fewer are left.
    pub fn take(&mut self, length: usize) -> Result<&'m mut [f32], Fault> {
        let all = core::mem::take(&mut self.left);
        let left = all.len();
        let (taken, rest) = all.split_at_mut_checked(length).ok_or(Fault::Memory {
            needed: length,
            left,
        })?;
        taken.fill(0.0);
        self.left = rest;
        Ok(taken)
    }
}
