//! The body that all targets share: `elm_tests::any_bytes` says what is checked.

pub use elm_tests::any_bytes;
pub use libfuzzer_sys;

/// A libFuzzer target for the reader of that name.
#[macro_export]
macro_rules! target {
    ($name:literal) => {
        $crate::libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
            let reader = $crate::any_bytes::reader($name).expect("a reader of that name");
            reader.check(bytes);
        });
    };
}
