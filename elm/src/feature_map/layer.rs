//! The random layer: weights and biases drawn once, and the forward pass
//! $f(\omega_k \cdot x_i + b_k)$ of equation 7, which fills the hidden-layer matrix of equation 9.
//!
//! That matrix is the paper's $F$; most of the literature, and this crate, call it $H$.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, ArrayViewMut2, Axis, s};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use super::distance;
use super::neurons::NodeType;
use crate::activation::Activation;
use crate::check::{check_length, check_matrix};
use crate::error::{Error, Result};
use crate::scalar::Scalar;
use crate::threads;

/// The random hidden layer of a network: it is drawn, never trained.
///
/// One seed gives one layer on every platform: ChaCha8, drawn in `f64` and then rounded to `A`,
/// neuron by neuron, so that a layer of 50 neurons is the beginning of one of 100. In a layer of
/// several [`groups`](Self::groups) each group has random numbers of its own, those of its place
/// among the groups, and the same holds group by group: 50 neurons of the second group are the
/// beginning of its 100, whatever the sizes of the others.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub struct HiddenLayer<A: Scalar> {
    /// Shape (inputs, neurons).
    pub(super) weights: Array2<A>,
    /// Shape (neurons).
    pub(super) biases: Array1<A>,
    /// In the order of the neurons.
    pub(super) groups: Vec<NeuronBlock<A>>,
}

/// Neurons of a layer that stand side by side and have one function.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub struct NeuronBlock<A: Scalar> {
    pub(super) neurons: usize,
    pub(super) activation: Activation<A>,
    /// What radial neurons multiply the inputs by.
    pub(super) radial: Option<Array1<A>>,
}

impl<A: Scalar> NeuronBlock<A> {
    /// Number of neurons.
    #[must_use]
    pub fn neurons(&self) -> usize {
        self.neurons
    }

    /// The activation function $f$.
    #[must_use]
    pub fn activation(&self) -> &Activation<A> {
        &self.activation
    }

    /// What the function is applied to.
    #[must_use]
    pub fn node_type(&self) -> NodeType {
        match self.radial {
            None => NodeType::Additive,
            Some(_) => NodeType::Rbf,
        }
    }

    /// What radial neurons multiply each input by before the distance is taken.
    #[must_use]
    pub fn input_scales(&self) -> Option<ArrayView1<'_, A>> {
        self.radial.as_ref().map(|scales| scales.view())
    }
}

impl<A: Scalar> HiddenLayer<A> {
    /// The hidden-layer matrix of `x`: shape (rows, inputs) to (rows, neurons).
    pub(crate) fn forward(&self, x: ArrayView2<'_, A>) -> Array2<A> {
        /// Rows that one thread takes at a time.
        const ROWS: usize = 512;
        // A function of the activation costs some tens of multiplications.
        let work = x.nrows() * self.neurons().saturating_mul(x.ncols() + 16);
        if work < threads::WORTHWHILE || x.nrows() < 2 * ROWS {
            return self.forward_rows(x);
        }
        let mut h = Array2::zeros((x.nrows(), self.neurons()));
        let parts = x.axis_chunks_iter(Axis(0), ROWS);
        let parts = parts.zip(h.axis_chunks_iter_mut(Axis(0), ROWS)).collect();
        threads::map(
            parts,
            |(x, mut to): (ArrayView2<'_, A>, ArrayViewMut2<'_, A>)| {
                to.assign(&self.forward_rows(x));
            },
        );
        h
    }

    fn forward_rows(&self, x: ArrayView2<'_, A>) -> Array2<A> {
        if let [group] = self.groups.as_slice()
            && group.radial.is_none()
        {
            let mut h = A::product(x, self.weights.view());
            h += &self.biases;
            group.activation.apply_in_place(h.view_mut());
            return h;
        }
        let mut h = Array2::zeros((x.nrows(), self.neurons()));
        let mut first = 0;
        for group in &self.groups {
            let columns = s![.., first..first + group.neurons];
            self.forward_group(group, first, x, h.slice_mut(columns));
            first += group.neurons;
        }
        h
    }

    fn forward_group(
        &self,
        group: &NeuronBlock<A>,
        first: usize,
        x: ArrayView2<'_, A>,
        mut to: ArrayViewMut2<'_, A>,
    ) {
        // Few enough that what a block makes stays in the second-level cache.
        const BLOCK: usize = 64;
        let columns = first..first + group.neurons;
        let weights = self.weights.slice(s![.., columns.clone()]);
        let biases = self.biases.slice(s![columns]);
        let blocks = x.axis_chunks_iter(Axis(0), BLOCK);
        for (x, mut to) in blocks.zip(to.axis_chunks_iter_mut(Axis(0), BLOCK)) {
            let mut z = match &group.radial {
                None => A::product(x, weights) + biases,
                Some(scales) => distance::distances((&x * scales).view(), weights),
            };
            group.activation.apply_in_place(z.view_mut());
            to.assign(&z);
        }
    }

    /// The layer of these neurons, given by rising numbers, such as those that
    /// [pruning](crate::prune) keeps.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a number that is not there, or does not rise.
    pub fn subset(&self, neurons: &[usize]) -> Result<Self> {
        let rising = neurons.windows(2).all(|pair| pair[0] < pair[1]);
        match neurons.last() {
            Some(&last) if !rising || last >= self.neurons() => Err(Error::Parameter {
                name: "neuron kept",
                value: last as f64,
                expected: "rising numbers, each below the number of neurons",
            }),
            _ => Ok(self.select(neurons)),
        }
    }

    /// The neurons of several layers as one layer, those of one function side by side, in their
    /// order otherwise; of one layer that layer itself.
    ///
    /// # Errors
    /// [`Error::Empty`] of none, [`Error::Shape`] for layers of different inputs.
    pub fn joined(layers: &[Self]) -> Result<Self> {
        let Some(first) = layers.first() else {
            return Err(Error::Empty {
                what: "layers",
                rows: 0,
                columns: 0,
            });
        };
        if layers.len() == 1 {
            return Ok(first.clone());
        }
        for layer in layers {
            check_length("inputs of a layer", layer.inputs(), first.inputs())?;
        }
        Ok(Self::join(&layers.iter().collect::<Vec<_>>()).0)
    }

    /// The layer of these neurons, given by rising numbers.
    pub(crate) fn select(&self, neurons: &[usize]) -> Self {
        let (mut first, mut groups) = (0, Vec::new());
        for group in &self.groups {
            let own = first..first + group.neurons;
            first = own.end;
            let kept = neurons.iter().filter(|&k| own.contains(k)).count();
            if kept > 0 {
                groups.push(NeuronBlock {
                    neurons: kept,
                    ..group.clone()
                });
            }
        }
        Self {
            weights: self.weights.select(Axis(1), neurons),
            biases: self.biases.select(Axis(0), neurons),
            groups,
        }
    }

    /// The neurons of several layers as one layer, those of one function side by side; and of each
    /// of its neurons, in which layer it was and its number there. The layers must have the same
    /// inputs.
    pub(crate) fn join(layers: &[&Self]) -> (Self, Vec<(usize, usize)>) {
        let mut groups: Vec<NeuronBlock<A>> = Vec::new();
        // Of each of these groups where its neurons come from.
        let mut order: Vec<Vec<(usize, usize)>> = Vec::new();
        for (place, layer) in layers.iter().enumerate() {
            let mut first = 0;
            for group in &layer.groups {
                let own = (first..first + group.neurons).map(|neuron| (place, neuron));
                first += group.neurons;
                let alike = |known: &NeuronBlock<A>| {
                    known.activation == group.activation && known.radial == group.radial
                };
                if let Some(known) = groups.iter().position(alike) {
                    groups[known].neurons += group.neurons;
                    order[known].extend(own);
                } else {
                    groups.push(group.clone());
                    order.push(own.collect());
                }
            }
        }
        let order = order.concat();
        let inputs = layers.first().map_or(0, |layer| layer.inputs());
        let mut weights = Array2::zeros((inputs, order.len()));
        for (mut column, &(layer, neuron)) in weights.columns_mut().into_iter().zip(&order) {
            column.assign(&layers[layer].weights.column(neuron));
        }
        let biases = order
            .iter()
            .map(|&(layer, neuron)| layers[layer].biases[neuron]);
        let layer = Self {
            biases: biases.collect(),
            weights,
            groups,
        };
        (layer, order)
    }

    /// Whether the parts of a layer from outside are finite and fit each other.
    pub(crate) fn check(&self) -> Result<()> {
        let (inputs, neurons) = self.weights.dim();
        check_matrix("hidden weights", self.weights.view())?;
        check_length("hidden biases", self.biases.len(), neurons)?;
        check_matrix("hidden biases", self.biases.view().insert_axis(Axis(0)))?;
        let grouped = self
            .groups
            .iter()
            .fold(0_usize, |sum, group| sum.saturating_add(group.neurons));
        check_length("neurons of the groups", grouped, neurons)?;
        for scales in self.groups.iter().filter_map(|group| group.radial.as_ref()) {
            check_length("scales of radial neurons", scales.len(), inputs)?;
            check_matrix(
                "scales of radial neurons",
                scales.view().insert_axis(Axis(0)),
            )?;
        }
        Ok(())
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.weights.nrows()
    }

    /// Number of neurons.
    #[must_use]
    pub fn neurons(&self) -> usize {
        self.weights.ncols()
    }

    /// The weights $\omega$, shape (inputs, neurons); of radial neurons the centers, in inputs that
    /// are multiplied by the [scales](NeuronBlock::input_scales) of their group.
    #[must_use]
    pub fn weights(&self) -> ArrayView2<'_, A> {
        self.weights.view()
    }

    /// The biases $b$, one per neuron; 0 for radial neurons.
    #[must_use]
    pub fn biases(&self) -> ArrayView1<'_, A> {
        self.biases.view()
    }

    /// The neurons by function, in the order of their weights.
    #[must_use]
    pub fn groups(&self) -> &[NeuronBlock<A>] {
        &self.groups
    }
}
