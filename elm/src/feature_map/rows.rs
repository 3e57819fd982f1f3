//! The features of given inputs, a few rows at a time: what fitting needs of the evaluator.

use std::ops::Range;

use ndarray::{Array2, ArrayView2, Axis, s};
use pulp::{Simd, WithSimd};

use super::FeatureMap;
use super::packed_map::{PackedMap, TILE_ROWS, TileBuffers, tile_rows};
use crate::error::Result;
use crate::scalar::Scalar;
use crate::simd::Lanes;

/// A feature map over the inputs that it is to be applied to. Rows are made when they are asked for;
/// the matrix of features never exists as a whole.
pub(crate) struct FeatureRows<'a, A: Scalar> {
    map: PackedMap<A>,
    direct_links: bool,
    x: ArrayView2<'a, A>,
}

impl<'a, A: Scalar> FeatureRows<'a, A> {
    /// `x` has shape (rows, inputs), and is finite.
    pub(crate) fn new(map: &FeatureMap<A>, x: ArrayView2<'a, A>) -> Self {
        let no_outputs = Array2::zeros((map.layer().neurons(), 0));
        let direct_links = map.direct_links();
        let map = PackedMap::new(map, no_outputs.view(), Vec::new());
        Self {
            map,
            direct_links,
            x,
        }
    }

    /// The number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.x.nrows()
    }

    /// Neurons, and what they see of the inputs where that is linked directly.
    pub(crate) fn columns(&self) -> usize {
        let links = if self.direct_links {
            self.map.packed.inputs
        } else {
            0
        };
        self.map.packed.neurons + links
    }

    /// Working memory for [`write`](Self::write).
    pub(crate) fn buffers(&self) -> TileBuffers<A> {
        self.map.buffers()
    }

    /// Writes these rows to `to`, each to the beginning of a line of `stride` values, less `shift`.
    pub(crate) fn write(
        &self,
        rows: Range<usize>,
        shift: &[A],
        (to, stride): (&mut [A], usize),
        buffers: &mut TileBuffers<A>,
    ) -> Result<()> {
        let offset = rows.start;
        let x = self.x.slice_move(s![rows, ..]);
        for (tile, x) in x.axis_chunks_iter(Axis(0), TILE_ROWS).enumerate() {
            let first = tile * TILE_ROWS;
            let to = &mut to[first * stride..];
            self.tile((x, offset + first), shift, (to, stride), buffers)?;
        }
        Ok(())
    }

    fn tile(
        &self,
        (x, offset): (ArrayView2<'_, A>, usize),
        shift: &[A],
        (to, stride): (&mut [A], usize),
        buffers: &mut TileBuffers<A>,
    ) -> Result<()> {
        let rows = x.nrows();
        let (packed, level) = (&self.map.packed, self.map.level);
        // Panels of each group are filled up, so that a neuron's index is not its position.
        let mut first = 0;
        self.map.tile(x, offset, buffers, |chunk| {
            let columns = first..first + chunk.neurons;
            level.run(Shift {
                from: chunk.hidden,
                from_stride: chunk.panels * A::LINE,
                shift: &shift[columns.clone()],
                to: &mut to[first..],
                to_stride: stride,
            });
            first = columns.end;
        })?;
        if self.direct_links {
            let inputs = &buffers.inputs[..rows * packed.inputs];
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
