//! A network's weights in the order in which evaluation reads them.

use aligned_vec::{AVec, ConstAlign};
use ndarray::{ArrayView1, ArrayView2};

use crate::scalar::Scalar;

/// Memory that starts at a cache line.
pub(super) type Aligned<A> = AVec<A, ConstAlign<64>>;

pub(super) fn zeros<A: Scalar>(length: usize) -> Aligned<A> {
    AVec::from_iter(64, std::iter::repeat_n(A::zero(), length))
}

/// Panels in a chunk. A chunk of hidden values for a tile of rows fits the first-level cache.
pub(super) const CHUNK_PANELS: usize = 16;

/// Weights by panel: as many neurons as there are values in a cache line, whatever the vector
/// unit. The last panel is filled up with neurons of weight 0.
#[derive(Debug, Clone)]
pub(super) struct Packed<A: Scalar> {
    pub(super) inputs: usize,
    pub(super) neurons: usize,
    pub(super) outputs: usize,
    /// Panels of neurons, and of inputs that reach the outputs directly.
    pub(super) panels: usize,
    pub(super) link_panels: usize,
    /// Per panel one line of biases, then a line of weights for each input.
    hidden: Aligned<A>,
    /// Per output one line for each panel of neurons, then for each panel of direct links.
    beta: Aligned<A>,
}

impl<A: Scalar> Packed<A> {
    /// `weights` has shape (inputs, neurons), `beta` (neurons, or neurons + inputs with direct
    /// links; outputs).
    pub(super) fn new(
        weights: ArrayView2<'_, A>,
        biases: ArrayView1<'_, A>,
        beta: ArrayView2<'_, A>,
    ) -> Self {
        let (inputs, neurons) = weights.dim();
        let links = beta.nrows().saturating_sub(neurons);
        let (panels, link_panels) = (neurons.div_ceil(A::LINE), links.div_ceil(A::LINE));

        let mut hidden = zeros(panels * (inputs + 1) * A::LINE);
        let panel_length = (inputs + 1) * A::LINE;
        for (k, (&bias, weights)) in biases.iter().zip(weights.columns()).enumerate() {
            let start = k / A::LINE * panel_length + k % A::LINE;
            let column = std::iter::once(&bias).chain(weights);
            let lines = hidden.iter_mut().skip(start).step_by(A::LINE);
            lines.zip(column).for_each(|(to, &from)| *to = from);
        }

        let line = (panels + link_panels) * A::LINE;
        let mut packed_beta = zeros(beta.ncols() * line);
        for (to, from) in packed_beta
            .chunks_exact_mut(line.max(1))
            .zip(beta.columns())
        {
            let (to_neurons, to_links) = to.split_at_mut(panels * A::LINE);
            let rows = from.iter();
            to_neurons
                .iter_mut()
                .take(neurons)
                .chain(to_links)
                .zip(rows)
                .for_each(|(to, &from)| *to = from);
        }
        Self {
            inputs,
            neurons,
            outputs: beta.ncols(),
            panels,
            link_panels,
            hidden,
            beta: packed_beta,
        }
    }

    /// Biases and weights of a range of panels.
    pub(super) fn hidden(&self, first: usize, count: usize) -> &[A] {
        let length = (self.inputs + 1) * A::LINE;
        self.hidden
            .get(first * length..(first + count) * length)
            .unwrap_or_default()
    }

    /// Output weights of a range of panels, links counted after neurons.
    pub(super) fn beta(&self, output: usize, first: usize, count: usize) -> &[A] {
        let start = (output * (self.panels + self.link_panels) + first) * A::LINE;
        self.beta
            .get(start..start + count * A::LINE)
            .unwrap_or_default()
    }
}
