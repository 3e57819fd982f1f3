//! A network's weights in the order in which evaluation reads them.

use ndarray::ArrayView2;

use super::layer::{HiddenLayer, NeuronBlock};
use crate::activation::Activation;
use crate::scalar::Scalar;
use crate::simd::{Aligned, zeros};

/// Panels in a chunk. A chunk of hidden values for a tile of rows fits the first-level cache.
pub(crate) const CHUNK_PANELS: usize = 16;

/// Panels of neurons that have one function.
#[derive(Debug, Clone)]
pub(crate) struct Panels<A: Scalar> {
    pub(crate) first: usize,
    pub(crate) count: usize,
    pub(crate) neurons: usize,
    pub(crate) activation: Activation<A>,
    /// What radial neurons multiply the inputs by.
    pub(crate) radial: Option<Vec<A>>,
}

/// Weights by panel: as many neurons as there are values in a cache line, whatever the vector
/// unit. The last panel of each group is filled up with neurons of weight 0.
#[derive(Debug, Clone)]
pub(crate) struct Packed<A: Scalar> {
    pub(crate) inputs: usize,
    pub(crate) neurons: usize,
    pub(crate) outputs: usize,
    /// Panels of neurons, and of inputs that reach the outputs directly.
    pub(crate) panels: usize,
    pub(crate) link_panels: usize,
    /// The panels of neurons by function.
    pub(crate) groups: Vec<Panels<A>>,
    /// Per panel one line of biases, then a line of weights for each input.
    hidden: Aligned<A>,
    /// Per output one line for each panel of neurons, then for each panel of direct links.
    beta: Aligned<A>,
}

impl<A: Scalar> Panels<A> {
    fn new(group: &NeuronBlock<A>, first: usize, count: usize) -> Self {
        Self {
            first,
            count,
            neurons: group.neurons(),
            activation: group.activation().clone(),
            radial: group.input_scales().map(|scales| scales.to_vec()),
        }
    }

    /// Number of real neurons, not padding, in a chunk of these panels.
    pub(super) fn real(&self, first: usize, count: usize) -> usize {
        (count * A::LINE).min(self.neurons - (first - self.first) * A::LINE)
    }

    /// Number of real neurons in a chunk of these panels where padding needs a treatment of its own: a
    /// user's function need not be finite at 0, and a distance may overflow.
    pub(super) fn used(&self, first: usize, count: usize) -> Option<usize> {
        let (all, used) = (count * A::LINE, self.real(first, count));
        let apart = self.radial.is_some() || matches!(self.activation, Activation::Custom(_));
        (apart && used < all).then_some(used)
    }
}

/// Per panel a line of biases, then a line of weights for each input.
fn hidden_lines<A: Scalar>(layer: &HiddenLayer<A>, panels: usize, places: &[usize]) -> Aligned<A> {
    let panel_length = (layer.inputs() + 1) * A::LINE;
    let mut hidden = zeros(panels * panel_length);
    let weights = layer.weights();
    let columns = layer.biases().into_iter().zip(weights.columns());
    for (&k, (bias, weights)) in places.iter().zip(columns) {
        let start = k / A::LINE * panel_length + k % A::LINE;
        let column = std::iter::once(bias).chain(weights);
        let lines = hidden.iter_mut().skip(start).step_by(A::LINE);
        lines.zip(column).for_each(|(to, &from)| *to = from);
    }
    hidden
}

impl<A: Scalar> Packed<A> {
    /// `beta` has shape (neurons, or neurons + inputs with direct links; outputs). Hidden weights are
    /// left out where `hidden` says so; returns also of each neuron its index among the panels' neurons.
    pub(crate) fn new(
        layer: &HiddenLayer<A>,
        beta: ArrayView2<'_, A>,
        hidden: bool,
    ) -> (Self, Vec<usize>) {
        let (inputs, neurons) = layer.weights().dim();
        let links = beta.nrows().saturating_sub(neurons);
        let link_panels = links.div_ceil(A::LINE);
        let mut panels = 0;
        let mut places = Vec::with_capacity(neurons);
        let mut groups = Vec::with_capacity(layer.groups().len());
        for group in layer.groups() {
            let count = group.neurons().div_ceil(A::LINE);
            places.extend((0..group.neurons()).map(|k| panels * A::LINE + k));
            groups.push(Panels::new(group, panels, count));
            panels += count;
        }

        let hidden = if hidden {
            hidden_lines(layer, panels, &places)
        } else {
            zeros(0)
        };
        let line = (panels + link_panels) * A::LINE;
        let mut packed_beta = zeros(beta.ncols() * line);
        for (to, from) in packed_beta
            .chunks_exact_mut(line.max(1))
            .zip(beta.columns())
        {
            let (to_neurons, to_links) = to.split_at_mut(panels * A::LINE);
            for (&place, &from) in places.iter().zip(from) {
                if let Some(to) = to_neurons.get_mut(place) {
                    *to = from;
                }
            }
            let links = from.iter().skip(neurons);
            to_links
                .iter_mut()
                .zip(links)
                .for_each(|(to, &from)| *to = from);
        }
        let packed = Self {
            inputs,
            neurons,
            outputs: beta.ncols(),
            panels,
            link_panels,
            groups,
            hidden,
            beta: packed_beta,
        };
        (packed, places)
    }

    /// Biases and weights of a range of panels.
    pub(crate) fn hidden(&self, first: usize, count: usize) -> &[A] {
        let length = (self.inputs + 1) * A::LINE;
        self.hidden
            .get(first * length..(first + count) * length)
            .unwrap_or_default()
    }

    /// Output weights of a range of panels, links counted after neurons.
    pub(crate) fn beta(&self, output: usize, first: usize, count: usize) -> &[A] {
        let start = (output * (self.panels + self.link_panels) + first) * A::LINE;
        self.beta
            .get(start..start + count * A::LINE)
            .unwrap_or_default()
    }
}
