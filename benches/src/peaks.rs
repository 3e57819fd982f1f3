//! Measures the machine's limits on one thread, which other figures are compared with.

use std::hint::black_box;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use pulp::{Arch, Simd, WithSimd};

use crate::timing::fastest_seconds;

/// Independent chains of multiply-adds: at least latency (4 or 5) times units (2), and few enough
/// for 16 registers.
const CHAINS: usize = 12;
/// Steps of each chain in one call.
const STEPS: usize = 20_000;
const REPETITIONS: usize = 30;

macro_rules! chains {
    ($name:ident, $element:ty, $splat:ident, $mul_add:ident, $sum:ident, $lanes:ident) => {
        struct $name;

        impl WithSimd for $name {
            /// Operations (a multiply-add is one) and a result that must be used.
            type Output = (usize, $element);

            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
                let (a, b) = (simd.$splat(black_box(0.999)), simd.$splat(black_box(0.001)));
                let mut chains = [simd.$splat(black_box(1.0)); CHAINS];
                for _ in 0..STEPS {
                    for chain in &mut chains {
                        *chain = simd.$mul_add(*chain, a, b);
                    }
                }
                let sum = chains.iter().map(|&chain| simd.$sum(chain)).sum();
                (CHAINS * STEPS * S::$lanes, sum)
            }
        }
    };
}

chains!(
    DoubleChains,
    f64,
    splat_f64s,
    mul_add_e_f64s,
    reduce_sum_f64s,
    F64_LANES
);
chains!(
    SingleChains,
    f32,
    splat_f32s,
    mul_add_e_f32s,
    reduce_sum_f32s,
    F32_LANES
);

/// A vector unit and its name.
#[must_use]
pub fn levels() -> Vec<(&'static str, Arch)> {
    let mut levels = vec![("one lane", Arch::Scalar)];
    #[cfg(target_arch = "x86_64")]
    {
        use pulp::x86::{V3, V4};
        levels.extend(V3::try_new().map(|simd| ("AVX2 + FMA", Arch::V3(simd))));
        levels.extend(V4::try_new().map(|simd| ("AVX-512", Arch::V4(simd))));
    }
    #[cfg(target_arch = "aarch64")]
    levels.extend(pulp::aarch64::Neon::try_new().map(|simd| ("NEON", Arch::Neon(simd))));
    levels
}

/// Multiply-adds per second in `f64`, each lane counted.
#[must_use]
pub fn multiply_add_f64(arch: Arch) -> f64 {
    let operations = arch.dispatch(DoubleChains).0;
    let seconds = fastest_seconds(REPETITIONS, || {
        black_box(arch.dispatch(DoubleChains));
    });
    operations as f64 / seconds
}

/// Multiply-adds per second in `f32`, each lane counted.
#[must_use]
pub fn multiply_add_f32(arch: Arch) -> f64 {
    let operations = arch.dispatch(SingleChains).0;
    let seconds = fastest_seconds(REPETITIONS, || {
        black_box(arch.dispatch(SingleChains));
    });
    operations as f64 / seconds
}

/// Multiply-adds per second of faer's product of two `size` x `size` matrices in `f64`.
#[must_use]
pub fn matrix_product(size: usize) -> f64 {
    let value = |i: usize, j: usize| ((i * 7 + j * 3) % 11) as f64 - 5.0;
    let (a, b) = (
        Mat::from_fn(size, size, value),
        Mat::from_fn(size, size, value),
    );
    let mut c = Mat::<f64>::zeros(size, size);
    let seconds = fastest_seconds(REPETITIONS, || {
        matmul(
            c.as_mut(),
            Accum::Replace,
            a.as_ref(),
            b.as_ref(),
            1.0,
            Par::Seq,
        );
    });
    (size as f64).powi(3) / seconds
}

/// Bytes per second of reading an array of `bytes`.
#[must_use]
pub fn read_bandwidth(bytes: usize) -> f64 {
    let values = vec![1.0_f64; bytes / size_of::<f64>()];
    let arch = Arch::new();
    let seconds = fastest_seconds(REPETITIONS, || {
        black_box(arch.dispatch(Sum(black_box(&values))));
    });
    bytes as f64 / seconds
}

struct Sum<'a>(&'a [f64]);

impl WithSimd for Sum<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let mut sums = [simd.splat_f64s(0.0); 8];
        let (registers, rest) = S::as_simd_f64s(self.0);
        for registers in registers.chunks_exact(sums.len()) {
            for (sum, &register) in sums.iter_mut().zip(registers) {
                *sum = simd.add_f64s(*sum, register);
            }
        }
        let sum: f64 = sums.iter().map(|&sum| simd.reduce_sum_f64s(sum)).sum();
        sum + rest.iter().sum::<f64>()
    }
}
