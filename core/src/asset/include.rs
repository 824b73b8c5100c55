//! Assets compiled into the program.

/// Bytes at an address that suits an asset.
#[derive(Debug)]
#[repr(C, align(16))]
pub struct Aligned<T: ?Sized>(pub T);

/// The bytes of a file, as [`include_bytes!`], at an address that is a multiple of 16.
///
/// ```
/// use sinew_core::asset::Asset;
/// static BYTES: &[u8] = sinew_core::include_asset!("../../../tests/golden/arm.sinew");
/// let asset = Asset::new_checked(BYTES)?;
/// # Ok::<(), sinew_core::asset::AssetError>(())
/// ```
#[macro_export]
macro_rules! include_asset {
    ($path:expr) => {{
        const ALIGNED: &$crate::asset::Aligned<[u8]> =
            &$crate::asset::Aligned(*include_bytes!($path));
        &ALIGNED.0
    }};
}
