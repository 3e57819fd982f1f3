//! What batch evaluation needs to know of `f32` and `f64`.

use pulp::Simd;

/// `f32` or `f64`: in vector registers, and with an exponential that a loop over a block can use.
/// No other type can be one, as none is an [`elm::Scalar`].
#[allow(missing_docs)]
pub trait Real: elm::Scalar {
    type Wide<S: Simd>: Copy;

    fn spread<S: Simd>(simd: S, value: Self) -> Self::Wide<S>;
    fn times<S: Simd>(simd: S, a: Self::Wide<S>, b: Self::Wide<S>) -> Self::Wide<S>;
    fn larger<S: Simd>(simd: S, a: Self::Wide<S>, b: Self::Wide<S>) -> Self::Wide<S>;
    fn multiply_add<S: Simd>(
        simd: S,
        a: Self::Wide<S>,
        b: Self::Wide<S>,
        c: Self::Wide<S>,
    ) -> Self::Wide<S>;
    fn wide<S: Simd>(slice: &[Self]) -> &[Self::Wide<S>];
    fn wide_mut<S: Simd>(slice: &mut [Self]) -> &mut [Self::Wide<S>];

    /// $e^y$ to a few units in the last place, for `y` taken into the range of normal numbers.
    fn exponential(y: Self) -> Self;
}

macro_rules! real {
    (
        $type:ident, $register:ident, $splat:ident, $mul:ident, $max:ident,
        $mul_add:ident, $registers:ident, $registers_mut:ident,
        digits: $digits:expr, bias: $bias:expr, magic: $magic:expr,
        range: $least:expr, $most:expr, ln2: $high:expr, $low:expr, polynomial: $polynomial:expr
    ) => {
        impl Real for $type {
            type Wide<S: Simd> = S::$register;

            #[inline(always)]
            fn spread<S: Simd>(simd: S, value: Self) -> S::$register {
                simd.$splat(value)
            }

            #[inline(always)]
            fn times<S: Simd>(simd: S, a: S::$register, b: S::$register) -> S::$register {
                simd.$mul(a, b)
            }

            #[inline(always)]
            fn larger<S: Simd>(simd: S, a: S::$register, b: S::$register) -> S::$register {
                simd.$max(a, b)
            }

            #[inline(always)]
            fn multiply_add<S: Simd>(
                simd: S,
                a: S::$register,
                b: S::$register,
                c: S::$register,
            ) -> S::$register {
                simd.$mul_add(a, b, c)
            }

            #[inline(always)]
            fn wide<S: Simd>(slice: &[Self]) -> &[S::$register] {
                S::$registers(slice).0
            }

            #[inline(always)]
            fn wide_mut<S: Simd>(slice: &mut [Self]) -> &mut [S::$register] {
                S::$registers_mut(slice).0
            }

            // y = n ln 2 + r; plain operations, which a compiler turns into vector code of any
            // width without changing a bit.
            #[inline(always)]
            #[allow(clippy::manual_clamp)] // NaN becomes a number so, which `clamp` keeps.
            fn exponential(y: Self) -> Self {
                const MAGIC: $type = $magic;
                let y = y.max($least).min($most);
                let n = (y * std::$type::consts::LOG2_E + MAGIC) - MAGIC;
                let r = (y - n * $high) - n * $low;
                let mut series: $type = 0.0;
                for coefficient in $polynomial {
                    series = series * r + coefficient;
                }
                // The integer n plus the exponent's bias stands in the lowest bits.
                let power = $type::from_bits((n + (MAGIC + $bias)).to_bits() << $digits);
                (series * (r * r) + r + 1.0) * power
            }
        }
    };
}

real!(
    f32, f32s, splat_f32s, mul_f32s, max_f32s, mul_add_e_f32s, as_simd_f32s, as_mut_simd_f32s,
    digits: 23, bias: 127.0, magic: 12_582_912.0, // 1.5 * 2^23
    range: -87.0, 88.0, ln2: 0.693_359_4, -2.121_944_4e-4,
    // Of (e^r - 1 - r) / r^2, the Taylor series' terms 2 to 7; what is missing is at most
    // (ln(2)/2)^8 / 8! = 5e-9.
    polynomial: [1.0 / 5040.0, 1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5]
);
real!(
    f64, f64s, splat_f64s, mul_f64s, max_f64s, mul_add_e_f64s, as_simd_f64s, as_mut_simd_f64s,
    digits: 52, bias: 1023.0, magic: 6_755_399_441_055_744.0, // 1.5 * 2^52
    range: -708.0, 709.0, ln2: 0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10,
    // Terms 2 to 13; missing: (ln(2)/2)^14 / 14! = 4e-18.
    polynomial: [
        1.0 / 6_227_020_800.0, 1.0 / 479_001_600.0, 1.0 / 39_916_800.0, 1.0 / 3_628_800.0,
        1.0 / 362_880.0, 1.0 / 40_320.0, 1.0 / 5040.0, 1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0,
        1.0 / 6.0, 0.5
    ]
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_that_of_the_standard_library_to_a_few_units_in_the_last_place() {
        for step in -8000..=8000 {
            let y = f64::from(step) * 0.0107;
            approx::assert_relative_eq!(
                f64::exponential(y),
                y.exp(),
                max_relative = 4.0 * f64::EPSILON
            );
            #[allow(clippy::cast_possible_truncation)]
            let z = y as f32;
            if (-87.0..88.0).contains(&z) {
                approx::assert_relative_eq!(
                    f64::from(f32::exponential(z)),
                    f64::from(z).exp(),
                    max_relative = 4.0 * f64::from(f32::EPSILON)
                );
            }
        }
        for y in [f32::NEG_INFINITY, f32::INFINITY, f32::NAN, -1e30, 1e30] {
            assert!(f32::exponential(y).is_finite(), "{y}");
            assert!(f64::exponential(f64::from(y)).is_finite(), "{y}");
        }
    }
}
