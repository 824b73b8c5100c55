//! Fixed storage that cannot panic.

/// An array whose every access is total: a read outside gives the default, a write outside is
/// ignored. Frame paths index with computed neighbours, and must hold no panic.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row<T, const N: usize>([T; N]);

impl<T: Copy + Default, const N: usize> Default for Row<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Copy + Default, const N: usize> Row<T, N> {
    pub(crate) fn new() -> Self {
        Self([T::default(); N])
    }

    #[inline]
    pub(crate) fn at(&self, index: usize) -> T {
        self.0.get(index).copied().unwrap_or_default()
    }

    #[inline]
    pub(crate) fn set(&mut self, index: usize, value: T) {
        if let Some(slot) = self.0.get_mut(index) {
            *slot = value;
        }
    }

    #[inline]
    pub(crate) fn edit(&mut self, index: usize, change: impl FnOnce(&mut T)) {
        if let Some(slot) = self.0.get_mut(index) {
            change(slot);
        }
    }

    #[inline]
    pub(crate) fn fill(&mut self, value: T) {
        self.0.fill(value);
    }

    #[inline]
    pub(crate) fn as_slice(&self, count: usize) -> &[T] {
        self.0.get(..count).unwrap_or(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outside_is_harmless() {
        let mut row = Row::<u8, 2>::new();
        row.set(1, 7);
        row.set(2, 9);
        assert_eq!((row.at(1), row.at(2)), (7, 0));
        assert_eq!(row.as_slice(5), [0, 7]);
    }
}
