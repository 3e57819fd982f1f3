//! The formulas run over slices, on the processor's best vector unit.

use pulp::{Simd, WithSimd};

use super::{Accuracy, Activation, Coefficients, formulas};
use crate::scalar::Scalar;
use crate::simd::{Lanes, Level};

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
            (Activation::Sigmoid, Full) => map(simd, values, formulas::sigmoid),
            (Activation::Sigmoid, Fast) => map(simd, values, formulas::sigmoid_fast),
            (Activation::Tanh, Full) => map(simd, values, formulas::tanh),
            (Activation::Tanh, Fast) => map(simd, values, formulas::tanh_fast),
            (Activation::Sine, Full) => map_sine(simd, values, formulas::sine),
            (Activation::Sine, Fast) => map_sine(simd, values, formulas::sine_fast),
            (Activation::Gaussian, Fast) if A::FAST_GAUSSIAN => {
                map(simd, values, formulas::gaussian_fast);
            }
            (Activation::Gaussian, _) => map(simd, values, formulas::gaussian),
            (Activation::Relu, _) => map(simd, values, formulas::relu),
            (Activation::HardLimit, _) => map(simd, values, formulas::hard_limit),
            (Activation::Isru, _) => map(simd, values, formulas::isru),
            (Activation::Linear | Activation::Custom(_), _) => {}
        }
    }
}

/// Applies `function` to whole registers, and to the rest in a register filled up with zeros.
#[inline(always)]
fn map<S: Simd, A: Coefficients>(
    simd: S,
    values: &mut [A],
    function: impl Fn(Lanes<S, A>) -> Lanes<S, A>,
) {
    let (registers, rest) = A::registers_mut::<S>(values);
    for register in registers {
        *register = function(Lanes::new(simd, *register)).register();
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
        *register = function(Lanes::new(simd, *register)).register();
    }
    rest.copy_from_slice(&buffer[..rest.len()]);
}

/// As [`map`], with the standard library's sine where an argument is too large for the formula.
#[inline(always)]
fn map_sine<S: Simd, A: Scalar>(
    simd: S,
    values: &mut [A],
    function: impl Fn(Lanes<S, A>) -> Lanes<S, A>,
) {
    // Small enough to stay in the first-level cache between the two looks at it.
    const BLOCK: usize = 512;
    for block in values.chunks_mut(BLOCK) {
        let (registers, rest) = A::registers::<S>(block);
        let largest = registers
            .iter()
            .fold(Lanes::splat(simd, A::ZERO), |largest, &register| {
                Lanes::new(simd, register).abs().max(largest)
            })
            .largest();
        let small = |z: A| z.abs() <= A::SINE_LIMIT;
        if small(largest) && rest.iter().all(|&z| small(z)) {
            map(simd, block, &function);
        } else {
            sine_of_large(simd, block, &function);
        }
    }
}

#[inline(always)]
fn sine_of_large<S: Simd, A: Scalar>(
    simd: S,
    values: &mut [A],
    function: impl Fn(Lanes<S, A>) -> Lanes<S, A>,
) {
    for part in values.chunks_mut(A::LINE) {
        let mut arguments = [A::ZERO; 16];
        let arguments = &mut arguments[..part.len()];
        arguments.copy_from_slice(part);
        map(simd, part, &function);
        for (value, &z) in part.iter_mut().zip(arguments.iter()) {
            if z.abs() > A::SINE_LIMIT {
                *value = z.sin();
            }
        }
    }
}
