//! Layers of neurons over a block of rows: lanes are rows, so that no sum crosses lanes.

use pulp::Simd;

use super::real::Real;
use super::{Block, ROWS};

/// Neurons whose sums are taken together, so that a value loaded serves all of them.
const TOGETHER: usize = 3;
/// Registers of rows that a weight loaded serves.
const WIDE: usize = 4;

/// A layer $z = W x + b$.
#[derive(Debug, Clone)]
pub(crate) struct Dense<A> {
    outputs: usize,
    /// By [`TOGETHER`] neurons: their biases, then for each input their weights; filled up with
    /// neurons of weight 0.
    weights: Vec<A>,
    /// Numbers in `weights` per block of neurons.
    stride: usize,
}

impl<A: Real> Dense<A> {
    /// `weight` gives the weight from an input to an output, `bias` that of an output.
    pub(crate) fn new(
        inputs: usize,
        outputs: usize,
        weight: impl Fn(usize, usize) -> f64,
        bias: impl Fn(usize) -> f64,
    ) -> Self {
        let mut weights = Vec::new();
        for first in (0..outputs).step_by(TOGETHER) {
            let neurons = first..first + TOGETHER;
            let real = |output: usize, value: &dyn Fn(usize) -> f64| {
                A::from_f64(if output < outputs { value(output) } else { 0.0 })
            };
            weights.extend(neurons.clone().map(|output| real(output, &bias)));
            for input in 0..inputs {
                let of_input = |output| weight(input, output);
                weights.extend(neurons.clone().map(|output| real(output, &of_input)));
            }
        }
        Self {
            outputs,
            weights,
            stride: (inputs + 1) * TOGETHER,
        }
    }

    /// Blocks that [`run`](Self::run) writes.
    pub(crate) fn blocks(&self) -> usize {
        self.outputs.next_multiple_of(TOGETHER)
    }

    /// The sums of a block of rows, `x` with a block for each input; with `RECTIFY`, 0 where they
    /// are negative.
    #[inline(always)]
    pub(crate) fn run<S: Simd, const RECTIFY: bool>(
        &self,
        simd: S,
        x: &[Block<A>],
        out: &mut [Block<A>],
    ) {
        let zero = A::spread(simd, A::zero());
        let neurons = self.weights.chunks_exact(self.stride);
        for (weights, out) in neurons.zip(out.as_chunks_mut::<TOGETHER>().0) {
            let (biases, weights) = weights.split_at(TOGETHER);
            let registers = A::wide::<S>(&[A::zero(); ROWS]).len();
            for first in (0..registers).step_by(WIDE) {
                let mut sums = [[zero; WIDE]; TOGETHER];
                for (sums, &bias) in sums.iter_mut().zip(biases) {
                    *sums = [A::spread(simd, bias); WIDE];
                }
                for (x, weights) in x.iter().zip(weights.as_chunks::<TOGETHER>().0) {
                    let x = &A::wide::<S>(&x.0)[first..first + WIDE];
                    for (sums, &weight) in sums.iter_mut().zip(weights) {
                        let weight = A::spread(simd, weight);
                        for (sum, &x) in sums.iter_mut().zip(x) {
                            *sum = A::multiply_add(simd, weight, x, *sum);
                        }
                    }
                }
                for (out, sums) in out.iter_mut().zip(&sums) {
                    let out = &mut A::wide_mut::<S>(&mut out.0)[first..first + WIDE];
                    for (out, &sum) in out.iter_mut().zip(sums) {
                        *out = if RECTIFY {
                            A::larger(simd, sum, zero)
                        } else {
                            sum
                        };
                    }
                }
            }
        }
    }
}

/// A function that costs so little that neurons go from weights to outputs without a stop in
/// memory.
pub(crate) trait Bend {
    fn at<S: Simd, A: Real>(simd: S, z: A::Wide<S>) -> A::Wide<S>;
}

/// $\max(0, z)$.
pub(crate) struct Rectified;

impl Bend for Rectified {
    #[inline(always)]
    fn at<S: Simd, A: Real>(simd: S, z: A::Wide<S>) -> A::Wide<S> {
        A::larger(simd, z, A::spread(simd, A::zero()))
    }
}

/// $\max(0, z)^2$.
pub(crate) struct SquaredRectified;

impl Bend for SquaredRectified {
    #[inline(always)]
    fn at<S: Simd, A: Real>(simd: S, z: A::Wide<S>) -> A::Wide<S> {
        let z = Rectified::at::<S, A>(simd, z);
        A::times(simd, z, z)
    }
}

/// A hidden layer with its output weights, for up to [`MAX_INPUTS`] inputs and three outputs.
#[derive(Debug, Clone)]
pub(crate) struct Fused<A> {
    inputs: usize,
    /// The constants of the outputs.
    constants: [A; TOGETHER],
    /// Per neuron its bias, its weights and its output weights.
    neurons: Vec<A>,
}

/// The most inputs of a [`Fused`].
pub(crate) const MAX_INPUTS: usize = 6;

impl<A: Real> Fused<A> {
    /// `hidden` gives the bias and the weights of each neuron, `beta` its output weights.
    pub(crate) fn new(
        inputs: usize,
        constants: [f64; TOGETHER],
        neurons: impl Iterator<Item = (f64, Vec<f64>, [f64; TOGETHER])>,
    ) -> Self {
        let mut packed = Vec::new();
        for (bias, weights, beta) in neurons {
            packed.push(A::from_f64(bias));
            packed.extend(weights.into_iter().map(A::from_f64));
            packed.extend(beta.map(A::from_f64));
        }
        Self {
            inputs,
            constants: constants.map(A::from_f64),
            neurons: packed,
        }
    }

    /// The outputs of a block of rows.
    #[inline(always)]
    pub(crate) fn run<S: Simd, F: Bend>(
        &self,
        simd: S,
        x: &[Block<A>],
        out: &mut [Block<A>; TOGETHER],
    ) {
        // With as many registers as the widest unit has, four of rows at once; else two.
        if size_of::<A::Wide<S>>() == 64 {
            self.by_inputs::<S, F, WIDE>(simd, x, out);
        } else {
            self.by_inputs::<S, F, 2>(simd, x, out);
        }
    }

    #[inline(always)]
    fn by_inputs<S: Simd, F: Bend, const G: usize>(
        &self,
        simd: S,
        x: &[Block<A>],
        out: &mut [Block<A>; TOGETHER],
    ) {
        match self.inputs {
            1 => self.go::<S, F, G, 1, 5>(simd, x, out),
            2 => self.go::<S, F, G, 2, 6>(simd, x, out),
            3 => self.go::<S, F, G, 3, 7>(simd, x, out),
            4 => self.go::<S, F, G, 4, 8>(simd, x, out),
            5 => self.go::<S, F, G, 5, 9>(simd, x, out),
            _ => self.go::<S, F, G, MAX_INPUTS, 10>(simd, x, out),
        }
    }

    /// `N` numbers of a neuron: a bias, `I` weights and three output weights.
    #[inline(always)]
    fn go<S: Simd, F: Bend, const G: usize, const I: usize, const N: usize>(
        &self,
        simd: S,
        x: &[Block<A>],
        out: &mut [Block<A>; TOGETHER],
    ) {
        let Some(x) = x.first_chunk::<I>() else {
            return;
        };
        let zero = A::spread(simd, A::zero());
        let registers = A::wide::<S>(&[A::zero(); ROWS]).len();
        for first in (0..registers).step_by(G) {
            let mut rows = [[zero; G]; I];
            for (rows, x) in rows.iter_mut().zip(x) {
                rows.copy_from_slice(&A::wide::<S>(&x.0)[first..first + G]);
            }
            let mut sums = [[zero; G]; TOGETHER];
            for (sums, &constant) in sums.iter_mut().zip(&self.constants) {
                *sums = [A::spread(simd, constant); G];
            }
            for neuron in self.neurons.as_chunks::<N>().0 {
                let mut z = [A::spread(simd, neuron[0]); G];
                for (rows, &weight) in rows.iter().zip(&neuron[1..=I]) {
                    let weight = A::spread(simd, weight);
                    for (z, &x) in z.iter_mut().zip(rows) {
                        *z = A::multiply_add(simd, weight, x, *z);
                    }
                }
                for z in &mut z {
                    *z = F::at::<S, A>(simd, *z);
                }
                for (sums, &beta) in sums.iter_mut().zip(&neuron[I + 1..]) {
                    let beta = A::spread(simd, beta);
                    for (sum, &z) in sums.iter_mut().zip(&z) {
                        *sum = A::multiply_add(simd, beta, z, *sum);
                    }
                }
            }
            for (out, sums) in out.iter_mut().zip(&sums) {
                A::wide_mut::<S>(&mut out.0)[first..first + G].copy_from_slice(sums);
            }
        }
    }
}
