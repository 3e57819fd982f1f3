//! The formulas run over slices, on the processor's best vector unit.

use pulp::{Simd, WithSimd};

use super::{Accuracy, Activation, formulas};
use crate::scalar::Scalar;
use crate::simd::{Coefficients, Lanes, Level};

/// One of [`formulas`] as a type: called through a closure or a function pointer it would be
/// compiled without the vector unit.
trait Formula {
    fn at<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A>;
}

mod formula {
    use super::{Coefficients, Formula, Lanes, Simd, formulas};

    macro_rules! formula {
        ($($name:ident is $function:ident;)*) => {
            $(pub(super) struct $name;

            impl Formula for $name {
                #[inline(always)]
                fn at<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
                    formulas::$function(z)
                }
            })*
        };
    }

    formula! {
        Sigmoid is sigmoid;
        SigmoidFast is sigmoid_fast;
        Tanh is tanh;
        TanhFast is tanh_fast;
        Sine is sine;
        SineFast is sine_fast;
        Gaussian is gaussian;
        GaussianFast is gaussian_fast;
        Relu is relu;
        SquaredRelu is squared_relu;
        HardLimit is hard_limit;
        Isru is isru;
    }
}

/// Applies a built-in function to every value.
pub(super) fn apply<A: Scalar>(
    level: Level,
    activation: &Activation<A>,
    accuracy: Accuracy,
    values: &mut [A],
) {
    level.run(Apply {
        activation,
        accuracy,
        values,
    });
}

struct Apply<'a, A: Scalar> {
    activation: &'a Activation<A>,
    accuracy: Accuracy,
    values: &'a mut [A],
}

impl<A: Scalar> WithSimd for Apply<'_, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        use Accuracy::{Fast, Full};
        let values = self.values;
        match (self.activation, self.accuracy) {
            (Activation::Sigmoid, Full) => map::<S, A, formula::Sigmoid>(simd, values),
            (Activation::Sigmoid, Fast) => map::<S, A, formula::SigmoidFast>(simd, values),
            (Activation::Tanh, Full) => map::<S, A, formula::Tanh>(simd, values),
            (Activation::Tanh, Fast) => map::<S, A, formula::TanhFast>(simd, values),
            (Activation::Sine, Full) => map_sine::<S, A, formula::Sine>(simd, values),
            (Activation::Sine, Fast) => map_sine::<S, A, formula::SineFast>(simd, values),
            (Activation::Gaussian, Fast) if A::FAST_GAUSSIAN => {
                map::<S, A, formula::GaussianFast>(simd, values);
            }
            (Activation::Gaussian, _) => map::<S, A, formula::Gaussian>(simd, values),
            (Activation::Relu, _) => map::<S, A, formula::Relu>(simd, values),
            (Activation::SquaredRelu, _) => map::<S, A, formula::SquaredRelu>(simd, values),
            (Activation::HardLimit, _) => map::<S, A, formula::HardLimit>(simd, values),
            (Activation::Isru, _) => map::<S, A, formula::Isru>(simd, values),
            (Activation::Linear | Activation::Custom(_), _) => {}
        }
    }
}

/// Applies a formula to whole registers, and to the rest in a register filled up with zeros.
#[inline(always)]
fn map<S: Simd, A: Coefficients, F: Formula>(simd: S, values: &mut [A]) {
    let (registers, rest) = A::registers_mut::<S>(values);
    for register in registers {
        *register = F::at(Lanes::<S, A>::new(simd, *register)).register();
    }
    if rest.is_empty() {
        return;
    }
    // No register has more than 64 bytes: 16 values of f32.
    let mut buffer = [A::ZERO; 16];
    let Some(used) = buffer.get_mut(..rest.len()) else {
        return;
    };
    used.copy_from_slice(rest);
    if let Some(register) = A::registers_mut::<S>(&mut buffer).0.first_mut() {
        *register = F::at(Lanes::<S, A>::new(simd, *register)).register();
    }
    rest.copy_from_slice(&buffer[..rest.len()]);
}

/// As [`map`], with the standard library's sine where an argument is too large for the formula.
#[inline(always)]
fn map_sine<S: Simd, A: Scalar, F: Formula>(simd: S, values: &mut [A]) {
    // Small enough to stay in the first-level cache between the two looks at it.
    const BLOCK: usize = 512;
    for block in values.chunks_mut(BLOCK) {
        let (registers, rest) = A::registers::<S>(block);
        let mut largest = Lanes::splat(simd, A::ZERO);
        for &register in registers {
            largest = Lanes::new(simd, register).abs().max(largest);
        }
        let largest = largest.largest();
        let small = |z: A| z.abs() <= A::SINE_LIMIT;
        if small(largest) && rest.iter().all(|&z| small(z)) {
            map::<S, A, F>(simd, block);
        } else {
            sine_of_large::<S, A, F>(simd, block);
        }
    }
}

#[inline(always)]
fn sine_of_large<S: Simd, A: Scalar, F: Formula>(simd: S, values: &mut [A]) {
    for part in values.chunks_mut(A::LINE) {
        let mut arguments = [A::ZERO; 16];
        let arguments = &mut arguments[..part.len()];
        arguments.copy_from_slice(part);
        map::<S, A, F>(simd, part);
        for (value, &z) in part.iter_mut().zip(arguments.iter()) {
            if z.abs() > A::SINE_LIMIT {
                *value = z.sin();
            }
        }
    }
}
