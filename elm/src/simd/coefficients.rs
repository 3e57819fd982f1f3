//! Constants of the vectorized activation functions. Polynomials are minimax: their largest error
//! over the interval is the smallest possible (Remez's exchange algorithm in 60 digits).

use super::real::Real;

/// The constants for `f32` and `f64`.
///
/// Not public: it is named by the sealed [`Scalar`](crate::Scalar) alone.
#[allow(missing_docs)]
pub trait Coefficients: Real {
    const TWO: Self;
    const HALF: Self;
    const LOG2_E: Self;
    const LN_2: Self;
    /// The first digits of ln 2: their product with any exponent is exact.
    const LN_2_HIGH: Self;
    /// The others.
    const LN_2_LOW: Self;
    /// $2^{64}$, and its inverse: keeps $2^n$ normal while a result becomes subnormal.
    const LIFT: Self;
    const LOWER: Self;
    const LIFT_EXPONENT: Self;
    /// $(r \coth(r/2) - 2) / r^2$ as a polynomial in $r^2$ for $|r| \le \ln(2)/2$.
    const COTH: &'static [Self];
    /// $(\sin(r)/r - 1) / r^2$ as a polynomial in $r^2$ for $|r| \le \pi/2$.
    const SINE: &'static [Self];
    /// The same with a relative error of 6e-9.
    const SINE_FAST: &'static [Self];
    const FRAC_1_PI: Self;
    /// $\pi$ in three parts, for Cody and Waite's reduction.
    const PI_PARTS: [Self; 3];
    /// Whether the products with `PI_PARTS` need a fused multiply-add to be accurate.
    const PI_NEEDS_FUSED: bool;
    /// Up to here the three parts of $\pi$ suffice.
    const SINE_LIMIT: Self;
    /// From here on $\tanh$ rounds to 1.
    const TANH_LIMIT: Self;
    /// From here on $e^{-z}$ rounds to 0.
    const SIGMOID_LIMIT: Self;
    /// From here on $e^{-z^2}$ rounds to 0.
    const GAUSSIAN_LIMIT: Self;
    /// From here on $z / \sqrt{1 + z^2}$ rounds to 1.
    const ISRU_LIMIT: Self;
    /// $\tanh z \approx z P(z^2) / Q(z^2)$ for $|z| \le 8$, to 1.3e-7.
    const TANH_FAST: ([Self; 4], [Self; 5]);
    const TANH_FAST_LIMIT: Self;
    /// $e^{-v/16}$ for $0 \le v \le 16$, to 1.5e-8.
    const EXP_FAST: [Self; 7];
    const EXP_FAST_LIMIT: Self;
    /// Whether the sixteenth power loses few enough digits.
    const FAST_GAUSSIAN: bool;
}

macro_rules! shared {
    () => {
        const TWO: Self = 2.0;
        const HALF: Self = 0.5;
        const LIFT: Self = 18_446_744_073_709_551_616.0;
        const LOWER: Self = 1.0 / Self::LIFT;
        const LIFT_EXPONENT: Self = 64.0;
        const SINE_FAST: &'static [Self] = &[
            -0.166_666_595_499_110_7,
            0.008_333_066_231_692_861,
            -0.000_198_096_017_500_930_78,
            2.605_777_884_979_392_4e-6,
        ];
        const TANH_FAST: ([Self; 4], [Self; 5]) = (
            [
                0.999_999_362_034_314_7,
                0.129_136_393_659_779_25,
                0.002_938_825_775_643_768_3,
                1.131_020_521_021_706_5e-5,
            ],
            [
                1.0,
                0.462_467_380_953_657_3,
                0.023_763_818_888_405_76,
                0.000_237_028_212_311_906_98,
                2.423_835_799_323_851_7e-7,
            ],
        );
        const TANH_FAST_LIMIT: Self = 8.0;
        const EXP_FAST: [Self; 7] = [
            0.999_999_985_180_777_9,
            -0.062_499_907_564_065_815,
            0.001_953_030_754_985_402_2,
            -4.065_392_986_569_190_4e-5,
            6.291_157_348_335_892e-7,
            -7.305_161_048_097_948e-9,
            5.071_777_353_685_433e-11,
        ];
        const EXP_FAST_LIMIT: Self = 16.0;
    };
}

impl Coefficients for f64 {
    shared!();
    const LOG2_E: Self = std::f64::consts::LOG2_E;
    const LN_2: Self = std::f64::consts::LN_2;
    const LN_2_HIGH: Self = 0.693_147_180_369_123_8;
    const LN_2_LOW: Self = 1.908_214_929_270_587_7e-10;
    // Error 1.7e-18.
    const COTH: &'static [Self] = &[
        0.166_666_666_666_666_02,
        -0.002_777_777_777_701_522_5,
        6.613_756_321_394_664e-5,
        -1.653_390_218_368_017_2e-6,
        4.138_136_345_295_660_4e-8,
    ];
    // Relative error 2.8e-19.
    const SINE: &'static [Self] = &[
        -0.166_666_666_666_666_66,
        0.008_333_333_333_333_194,
        -0.000_198_412_698_412_092_13,
        2.755_731_921_113_608e-6,
        -2.505_210_687_268_556_7e-8,
        1.605_893_969_972_865e-10,
        -7.642_991_322_216_221e-13,
        2.721_173_143_669_07e-15,
    ];
    const FRAC_1_PI: Self = std::f64::consts::FRAC_1_PI;
    // 33 digits each in the first two: exact products with integers below 2^20.
    const PI_PARTS: [Self; 3] = [
        3.141_592_653_468_251_2,
        1.215_420_101_260_793_2e-10,
        4.044_532_497_591_901e-21,
    ];
    const PI_NEEDS_FUSED: bool = false;
    const SINE_LIMIT: Self = 1e6;
    const TANH_LIMIT: Self = 20.0;
    const SIGMOID_LIMIT: Self = 746.0;
    const GAUSSIAN_LIMIT: Self = 27.4;
    const ISRU_LIMIT: Self = 1e10;
    const FAST_GAUSSIAN: bool = true;
}

#[allow(clippy::excessive_precision)]
impl Coefficients for f32 {
    shared!();
    const LOG2_E: Self = std::f32::consts::LOG2_E;
    const LN_2: Self = std::f32::consts::LN_2;
    const LN_2_HIGH: Self = 0.693_145_751_953_125;
    const LN_2_LOW: Self = 1.428_606_820_309_417_3e-6;
    // Error 4.4e-9.
    const COTH: &'static [Self] = &[0.166_666_257_422_124_32, -0.002_766_753_457_400_945];
    const SINE: &'static [Self] = Self::SINE_FAST;
    const FRAC_1_PI: Self = std::f32::consts::FRAC_1_PI;
    // 24 digits each.
    const PI_PARTS: [Self; 3] = [
        3.141_592_741_012_573_2,
        -8.742_277_657_347_586e-8,
        -3.430_249_020_011_763_7e-15,
    ];
    const PI_NEEDS_FUSED: bool = true;
    const SINE_LIMIT: Self = 1e5;
    const TANH_LIMIT: Self = 10.0;
    const SIGMOID_LIMIT: Self = 105.0;
    const GAUSSIAN_LIMIT: Self = 11.0;
    const ISRU_LIMIT: Self = 1e5;
    const FAST_GAUSSIAN: bool = false;
}
