//! A network of this project, packed for evaluation by columns.

use crate::fit::Model;
use elm::{Activation, Elm, NodeType};
use elm_datasets::brdf::EvalError;
use ndarray::{Array1, Array2, ArrayViewMut2};
use pulp::Simd;

use super::dense::{Dense, Fused, MAX_INPUTS, Rectified, SquaredRectified};
use super::real::Real;
use super::{Batched, Block, Columns, Kernel, ROWS, eval_pairs, inputs, run};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::model::BrdfModel;
use crate::target_transform::Channel;
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;

/// A [`BrdfModel`] packed for [evaluation by columns](crate::batch) in `f32` or `f64`.
///
/// In `f64` it agrees with [`BrdfModel::eval`](Brdf::eval) but for rounding; in `f32` as far as
/// single precision goes, which for the output weights of an ill-conditioned fit is not far.
///
/// Cheapest are networks of up to six inputs whose neurons are [`Activation::Relu`] or
/// [`Activation::SquaredRelu`] all: those never leave the registers.
#[derive(Debug, Clone)]
pub struct Packed<A: Real> {
    features: Features,
    neurons: usize,
    layers: Layers<A>,
    /// Outputs of the network.
    outputs: usize,
    /// From the outputs to the targets of all channels, where they are fewer.
    basis: Option<Dense<A>>,
    transforms: Vec<InverseTransform<A>>,
    /// What each channel adds to red, green and blue, where the values are colours.
    color: Option<Vec<[A; 3]>>,
    multiply_adds: usize,
    floats: usize,
    floats_per_channel: usize,
}

#[derive(Debug, Clone)]
enum Layers<A: Real> {
    /// Three outputs each.
    Rectified(Vec<Fused<A>>),
    SquaredRectified(Vec<Fused<A>>),
    /// Functions by how many neurons have them.
    Any {
        hidden: Dense<A>,
        functions: Vec<(usize, Activation<A>)>,
        output: Dense<A>,
    },
}

/// [`Channel`] in the precision of the evaluation.
#[derive(Debug, Clone, Copy)]
enum InverseTransform<A> {
    Identity,
    Log { offset: A, ceiling: A },
    CubeRoot { ceiling: A },
}

impl<A: Real> Layers<A> {
    fn of(network: &Elm<f64>) -> Result<Self> {
        let refused = |first| {
            Err(Error::Conflict {
                first,
                second: "evaluation by columns",
            })
        };
        let (layer, beta) = (network.hidden(), network.beta());
        if layer
            .groups()
            .iter()
            .any(|group| group.node_type() != NodeType::Additive)
        {
            return refused("radial neurons");
        }
        if beta.nrows() != layer.neurons() {
            return refused("direct transforms");
        }
        let mut functions = Vec::new();
        for group in layer.groups() {
            let Ok(function) = group.activation().name().parse::<Activation<A>>() else {
                return refused("a function of the user's own");
            };
            functions.push((group.neurons(), function));
        }

        // The scaling of inputs, folded in.
        let inputs = network.inputs();
        let mut weights: Array2<f64> = layer.weights().to_owned();
        let mut biases = layer.biases().to_owned();
        if let Some(scaler) = network.scaler() {
            for (mut row, &factor) in weights.rows_mut().into_iter().zip(scaler.factor()) {
                row *= factor;
            }
            biases -= &scaler.mean().dot(&weights);
        }

        let all = |function: Activation<A>| functions.iter().all(|(_, other)| *other == function);
        let fused = || fused(network, &weights, &biases);
        if inputs <= MAX_INPUTS && all(Activation::Relu) {
            return Ok(Self::Rectified(fused()));
        }
        if inputs <= MAX_INPUTS && all(Activation::SquaredRelu) {
            return Ok(Self::SquaredRectified(fused()));
        }
        let intercept = network.intercept();
        Ok(Self::Any {
            hidden: Dense::new(
                inputs,
                layer.neurons(),
                |input, neuron| weights[[input, neuron]],
                |neuron| biases[neuron],
            ),
            functions,
            output: Dense::new(
                layer.neurons(),
                network.outputs(),
                |neuron, output| beta[[neuron, output]],
                |output| intercept[output],
            ),
        })
    }
}

/// A network with these hidden weights and biases, three outputs at a time.
fn fused<A: Real>(
    network: &Elm<f64>,
    weights: &Array2<f64>,
    biases: &Array1<f64>,
) -> Vec<Fused<A>> {
    let (beta, intercept) = (network.beta(), network.intercept());
    let triple = |first: usize| {
        let three = |of: &dyn Fn(usize) -> Option<f64>| {
            [first, first + 1, first + 2].map(|number| of(number).unwrap_or(0.0))
        };
        let neurons = (0..weights.ncols()).map(|neuron| {
            let beta = three(&|output| beta.get((neuron, output)).copied());
            (biases[neuron], weights.column(neuron).to_vec(), beta)
        });
        let constants = three(&|output| intercept.get(output).copied());
        Fused::new(network.inputs(), constants, neurons)
    };
    (0..network.outputs()).step_by(3).map(triple).collect()
}

impl<A: Real> Packed<A> {
    /// Packs a model.
    ///
    /// # Errors
    /// [`Error::Conflict`] for a network with radial neurons, direct transforms or a function of
    /// the user's own.
    pub fn new(model: &BrdfModel) -> Result<Self> {
        let network = model.network();
        let layers = Layers::of(network)?;
        let basis = model.target_transform().basis().map(|basis| {
            let (axes, mean) = (basis.axes(), basis.mean());
            let weight = |output: usize, channel: usize| axes[[output, channel]];
            Dense::new(basis.outputs(), basis.channels(), weight, |k| mean[k])
        });
        let color = model.target_transform().color().map(|weights| {
            let packed = weights.iter().map(|three| three.map(A::from_f64));
            packed.collect()
        });
        Ok(Self {
            features: model.features(),
            neurons: network.hidden().neurons(),
            layers,
            outputs: network.outputs(),
            basis,
            color,
            multiply_adds: model.multiply_adds(),
            transforms: model
                .target_transform()
                .by_channel()
                .iter()
                .map(InverseTransform::new)
                .collect(),
            floats: model.stored_floats(),
            floats_per_channel: model.floats_per_channel(),
        })
    }

    /// Number of hidden neurons.
    #[must_use]
    pub fn neurons(&self) -> usize {
        self.neurons
    }

    fn inputs(&self) -> usize {
        self.features.inputs().len()
    }

    /// Blocks that the network's outputs take, in threes.
    fn output_blocks(&self) -> usize {
        self.outputs.next_multiple_of(3)
    }

    /// Values for each pair.
    fn values(&self) -> usize {
        self.color.as_ref().map_or(self.transforms.len(), |_| 3)
    }
}

impl<A: Real> InverseTransform<A> {
    fn new(channel: &Channel) -> Self {
        // A ceiling beyond the range of single precision is none.
        let ceiling = |ceiling: f64| A::from_f64(ceiling).min(A::max_value());
        match *channel {
            Channel::Identity => Self::Identity,
            Channel::Log { offset, ceiling: c } => Self::Log {
                offset: A::from_f64(offset),
                ceiling: ceiling(c),
            },
            Channel::CubeRoot { ceiling: c } => Self::CubeRoot {
                ceiling: ceiling(c),
            },
        }
    }

    /// Values of a block from targets; 0 where a direction is not above the horizon.
    #[inline(always)]
    fn values(self, targets: &Block<A>, iz: &[A; ROWS], oz: &[A; ROWS], out: &mut Block<A>) {
        let zero = A::zero();
        let above = |r: usize| iz[r] > zero && oz[r] > zero;
        match self {
            Self::Identity => {
                for r in 0..ROWS {
                    // Comparing with itself: not NaN.
                    let target = targets.0[r];
                    let is_number = target.abs() <= A::max_value();
                    out.0[r] = if above(r) && is_number { target } else { zero };
                }
            }
            Self::Log { offset, ceiling } => {
                for r in 0..ROWS {
                    let value = offset * (A::exponential(targets.0[r]) - A::one());
                    // In this order NaN becomes 0.
                    let value = value.max(zero).min(ceiling);
                    out.0[r] = if above(r) { value } else { zero };
                }
            }
            Self::CubeRoot { ceiling } => {
                for r in 0..ROWS {
                    let target = targets.0[r];
                    let value = (target * target * target).max(zero).min(ceiling);
                    out.0[r] = if above(r) { value } else { zero };
                }
            }
        }
    }
}

impl<A: Real> Kernel<A> for Packed<A> {
    fn scratch(&self) -> usize {
        let hidden = match &self.layers {
            Layers::Any { hidden, .. } => hidden.blocks(),
            _ => 0,
        };
        let basis = self.basis.as_ref().map_or(0, Dense::blocks);
        self.inputs() + self.output_blocks() + hidden + basis
    }

    #[inline(always)]
    fn block<S: Simd>(
        &self,
        simd: S,
        directions: &[&[A; ROWS]; 6],
        scratch: &mut [Block<A>],
        out: &mut [Block<A>],
    ) {
        let (x, rest) = scratch.split_at_mut(self.inputs());
        let (targets, rest) = rest.split_at_mut(self.output_blocks());
        let basis = self.basis.as_ref().map_or(0, Dense::blocks);
        let (of_channels, hidden_values) = rest.split_at_mut(basis);
        inputs::compute(self.features, directions, x);
        match &self.layers {
            Layers::Rectified(layers) => {
                for (layer, targets) in layers.iter().zip(targets.as_chunks_mut::<3>().0) {
                    layer.run::<S, Rectified>(simd, x, targets);
                }
            }
            Layers::SquaredRectified(layers) => {
                for (layer, targets) in layers.iter().zip(targets.as_chunks_mut::<3>().0) {
                    layer.run::<S, SquaredRectified>(simd, x, targets);
                }
            }
            Layers::Any {
                hidden,
                functions,
                output,
            } => {
                hidden.run::<S, false>(simd, x, hidden_values);
                let mut rest = &mut *hidden_values;
                for (neurons, function) in functions {
                    let (own, others) = rest.split_at_mut(*neurons);
                    for block in own {
                        function.apply_to(&mut block.0);
                    }
                    rest = others;
                }
                output.run::<S, false>(simd, &hidden_values[..self.neurons], targets);
            }
        }
        let targets = match &self.basis {
            None => &*targets,
            Some(basis) => {
                basis.run::<S, false>(simd, &targets[..self.outputs], of_channels);
                &*of_channels
            }
        };
        let (iz, oz) = (directions[2], directions[5]);
        match &self.color {
            None => {
                for ((transform, targets), out) in self.transforms.iter().zip(targets).zip(out) {
                    transform.values(targets, iz, oz, out);
                }
            }
            Some(weights) => {
                out.fill(Block::zero());
                let mut value = Block::zero();
                for ((transform, targets), weights) in
                    self.transforms.iter().zip(targets).zip(weights)
                {
                    transform.values(targets, iz, oz, &mut value);
                    for (out, &weight) in out.iter_mut().zip(weights) {
                        for (sum, &value) in out.0.iter_mut().zip(&value.0) {
                            *sum += weight * value;
                        }
                    }
                }
                // What a screen cannot show.
                for part in out.iter_mut().flat_map(|out| &mut out.0) {
                    *part = part.max(A::zero());
                }
            }
        }
    }
}

impl<A: Real> Packed<A> {
    /// BRDF in 1/sr, without the cosine: all values of the first channel, then those of the next.
    ///
    /// # Errors
    /// [`Error::Shape`] unless `out` has a value for each pair and channel.
    pub fn eval_into(&self, directions: &Columns<A>, out: &mut [A]) -> Result<()> {
        run(self, self.values(), directions, out)
    }
}

impl<A: Real> Batched<A> for Packed<A> {
    fn channels(&self) -> usize {
        self.values()
    }

    fn eval_into(&self, directions: &Columns<A>, out: &mut [A]) -> Result<()> {
        Packed::eval_into(self, directions, out)
    }
}

macro_rules! brdf {
    ($type:ident, $precision:ident) => {
        impl Brdf for Packed<$type> {
            fn channels(&self) -> usize {
                self.values()
            }

            fn is_isotropic(&self) -> bool {
                self.features.is_isotropic()
            }

            fn eval_into(
                &self,
                pairs: &[DirectionPair],
                values: ArrayViewMut2<'_, f64>,
            ) -> Result<(), EvalError> {
                eval_pairs(self, pairs, values)
            }
        }

        impl Model for Packed<$type> {
            fn multiply_adds(&self) -> usize {
                self.multiply_adds
            }

            fn floats_per_channel(&self) -> usize {
                self.floats_per_channel
            }

            fn stored_floats(&self) -> usize {
                self.floats
            }
        }
    };
}

brdf!(f32, Single);
brdf!(f64, Double);
