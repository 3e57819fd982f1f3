//! The hidden layer alone, a few rows at a time: what fitting needs of the evaluator.

use std::ops::Range;

use ndarray::{ArrayView2, Axis, s};
use pulp::{Simd, WithSimd};

use super::kernels::Project;
use super::packed::CHUNK_PANELS;
use super::{Packed, Predictor, Scratch, TILE_ROWS, multiply, tile_rows};
use crate::activation::Accuracy;
use crate::error::Result;
use crate::hidden::HiddenLayer;
use crate::scalar::Scalar;
use crate::scaler::Scaler;
use crate::simd::{Lanes, Level};

/// A hidden layer over the inputs it is to be applied to, standardised on the way. Rows are made
/// when they are asked for; the hidden-layer matrix never exists as a whole.
pub(crate) struct LayerRows<'a, A: Scalar> {
    layer: Predictor<A>,
    scratch: Scratch<A>,
    direct_links: bool,
    x: ArrayView2<'a, A>,
}

impl<'a, A: Scalar> LayerRows<'a, A> {
    /// `x` has shape (rows, inputs), and is finite.
    pub(crate) fn new(
        hidden: &HiddenLayer<A>,
        scaler: Option<&Scaler<A>>,
        direct_links: bool,
        x: ArrayView2<'a, A>,
    ) -> Self {
        let no_outputs = ndarray::Array2::zeros((hidden.neurons(), 0));
        let layer = Predictor {
            packed: Packed::new(hidden, no_outputs.view()),
            scaler: scaler.cloned(),
            intercept: Vec::new(),
            input_bounds: Vec::new(),
            output_bounds: Vec::new(),
            accuracy: Accuracy::Full,
            level: Level::best(),
        };
        Self {
            scratch: layer.scratch(),
            layer,
            direct_links,
            x,
        }
    }

    /// The number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.x.nrows()
    }

    /// Neurons, and inputs where they are linked directly.
    pub(crate) fn columns(&self) -> usize {
        let links = if self.direct_links { self.x.ncols() } else { 0 };
        self.layer.neurons() + links
    }

    /// Writes these rows to `to`, each to the beginning of a line of `stride` values, less `shift`.
    pub(crate) fn write(
        &mut self,
        rows: Range<usize>,
        shift: &[A],
        to: &mut [A],
        stride: usize,
    ) -> Result<()> {
        let offset = rows.start;
        let x = self.x.slice_move(s![rows, ..]);
        for (tile, x) in x.axis_chunks_iter(Axis(0), TILE_ROWS).enumerate() {
            let first = tile * TILE_ROWS;
            let to = &mut to[first * stride..];
            self.tile(x, offset + first, shift, to, stride)?;
        }
        Ok(())
    }

    fn tile(
        &mut self,
        x: ArrayView2<'_, A>,
        offset: usize,
        shift: &[A],
        to: &mut [A],
        stride: usize,
    ) -> Result<()> {
        let (layer, packed) = (&self.layer, &self.layer.packed);
        let rows = x.nrows();
        let inputs = &mut self.scratch.inputs[..rows * packed.inputs];
        layer.standardise(x, inputs, offset)?;
        let inputs = &*inputs;
        // Panels of each group are filled up, so that a neuron's place is not its number.
        let mut first = 0;
        for group in &packed.groups {
            let inputs = match &group.radial {
                None => inputs,
                Some(scales) => {
                    let scaled = &mut self.scratch.scaled[..rows * packed.inputs];
                    multiply(inputs, scales, rows, scaled);
                    &*scaled
                }
            };
            let (end, last) = (group.first + group.count, first + group.neurons);
            for first_panel in (group.first..end).step_by(CHUNK_PANELS) {
                let panels = CHUNK_PANELS.min(end - first_panel);
                let hidden = &mut self.scratch.hidden[..rows * panels * A::LINE];
                layer.level.run(Project {
                    packed,
                    first_panel,
                    panels,
                    rows,
                    radial: group.radial.is_some(),
                    inputs,
                    hidden,
                });
                layer.activate(group, hidden, first_panel, panels);
                let columns = first..last.min(first + panels * A::LINE);
                layer.level.run(Shift {
                    from: hidden,
                    from_stride: panels * A::LINE,
                    shift: &shift[columns.clone()],
                    to: &mut to[first..],
                    to_stride: stride,
                });
                first = columns.end;
            }
        }
        if self.direct_links {
            let links = packed.neurons..packed.neurons + packed.inputs;
            for (row, inputs) in tile_rows(inputs, packed.inputs, rows) {
                let to = &mut to[row * stride..][links.clone()];
                for ((to, value), &shift) in to.iter_mut().zip(inputs).zip(&shift[links.clone()]) {
                    *to = value - shift;
                }
            }
        }
        Ok(())
    }
}

/// Copies rows, each less `shift`.
struct Shift<'a, A: Scalar> {
    from: &'a [A],
    from_stride: usize,
    shift: &'a [A],
    to: &'a mut [A],
    to_stride: usize,
}

impl<A: Scalar> WithSimd for Shift<'_, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let length = self.shift.len();
        let (shift, shift_rest) = A::registers::<S>(self.shift);
        let rows = self.from.chunks_exact(self.from_stride);
        for (from, to) in rows.zip(self.to.chunks_mut(self.to_stride)) {
            let (from, from_rest) = A::registers::<S>(&from[..length]);
            let (to, to_rest) = A::registers_mut::<S>(&mut to[..length]);
            for ((to, &from), &shift) in to.iter_mut().zip(from).zip(shift) {
                *to = (Lanes::<S, A>::new(simd, from) - Lanes::new(simd, shift)).register();
            }
            for ((to, &from), &shift) in to_rest.iter_mut().zip(from_rest).zip(shift_rest) {
                *to = from - shift;
            }
        }
    }
}
