//! A feature map packed for evaluation, tile by tile.

use ndarray::ArrayView2;

use super::FeatureMap;
use super::kernels::{Project, row_blocks};
use super::packed::{CHUNK_PANELS, Packed, Panels};
use super::scaler::Scaler;
use crate::activation::Accuracy;
use crate::error::{Error, Result};
use crate::scalar::Scalar;
use crate::simd::{Aligned, Level, zeros};

/// Rows evaluated together.
pub(crate) const TILE_ROWS: usize = 16;

/// A feature map, and the readout of its features, in the order in which vector code reads them.
#[derive(Debug, Clone)]
pub(crate) struct PackedMap<A: Scalar> {
    pub(crate) packed: Packed<A>,
    scaler: Option<Scaler<A>>,
    /// What each input is held between; empty where they are not.
    input_bounds: Vec<(A, A)>,
    pub(crate) accuracy: Accuracy,
    pub(crate) level: Level,
}

/// Working memory for a tile of rows.
#[derive(Debug, Clone)]
pub(crate) struct TileBuffers<A: Scalar> {
    /// Inputs, standardized, as [`Project`] wants them.
    pub(crate) inputs: Aligned<A>,
    /// The same, multiplied by the scales of a group of radial neurons.
    scaled: Aligned<A>,
    /// One chunk of the hidden layer.
    pub(crate) hidden: Aligned<A>,
}

/// Hidden values of a tile: a row after the other, each of whole panels.
pub(crate) struct Chunk<'a, A: Scalar> {
    pub(crate) hidden: &'a [A],
    pub(crate) first_panel: usize,
    pub(crate) panels: usize,
    /// Number of real neurons, not padding.
    pub(crate) neurons: usize,
}

impl<A: Scalar> PackedMap<A> {
    /// `beta` is the readout, shape (features, outputs).
    pub(crate) fn new(
        map: &FeatureMap<A>,
        beta: ArrayView2<'_, A>,
        input_bounds: Vec<(A, A)>,
    ) -> Self {
        Self {
            packed: Packed::new(map.layer(), beta),
            scaler: map.scaler().cloned(),
            input_bounds,
            accuracy: Accuracy::Full,
            level: Level::best(),
        }
    }

    /// Lengths of the buffers: inputs, scaled, hidden.
    pub(crate) fn lengths(&self) -> [usize; 3] {
        let groups = &self.packed.groups;
        let neurons = groups.iter().map(|group| group.count);
        let panels = neurons.chain([self.packed.link_panels]).max().unwrap_or(0);
        let radial = groups.iter().any(|group| group.radial.is_some());
        let inputs = TILE_ROWS * self.packed.inputs;
        [
            inputs,
            if radial { inputs } else { 0 },
            TILE_ROWS * panels.min(CHUNK_PANELS) * A::LINE,
        ]
    }

    pub(crate) fn buffers(&self) -> TileBuffers<A> {
        let [inputs, scaled, hidden] = self.lengths().map(zeros);
        TileBuffers {
            inputs,
            scaled,
            hidden,
        }
    }

    /// Standardizes a tile of rows, and hands its hidden values to `take`, chunk by chunk. `offset` is
    /// the number of the first row in messages.
    pub(crate) fn tile(
        &self,
        x: ArrayView2<'_, A>,
        offset: usize,
        buffers: &mut TileBuffers<A>,
        mut take: impl FnMut(Chunk<'_, A>),
    ) -> Result<()> {
        let (rows, packed) = (x.nrows(), &self.packed);
        let inputs = &mut buffers.inputs[..rows * packed.inputs];
        self.standardize(x, inputs, offset)?;
        for group in &packed.groups {
            let inputs = match &group.radial {
                None => &*inputs,
                Some(scales) => {
                    let scaled = &mut buffers.scaled[..rows * packed.inputs];
                    multiply(inputs, scales, rows, scaled);
                    &*scaled
                }
            };
            let end = group.first + group.count;
            for first_panel in (group.first..end).step_by(CHUNK_PANELS) {
                let panels = CHUNK_PANELS.min(end - first_panel);
                let hidden = &mut buffers.hidden[..rows * panels * A::LINE];
                self.level.run(Project {
                    packed,
                    first_panel,
                    panels,
                    rows,
                    radial: group.radial.is_some(),
                    inputs,
                    hidden,
                });
                self.activate(group, hidden, first_panel, panels);
                take(Chunk {
                    hidden,
                    first_panel,
                    panels,
                    neurons: group.real(first_panel, panels),
                });
            }
        }
        Ok(())
    }

    /// Copies a tile of inputs, standardized, into blocks of rows.
    fn standardize(&self, x: ArrayView2<'_, A>, to: &mut [A], offset: usize) -> Result<()> {
        let inputs = self.packed.inputs;
        let mut finite = true;
        for (first, rows) in row_blocks(x.nrows()) {
            let block = &mut to[first * inputs..(first + rows) * inputs];
            for r in 0..rows {
                let row = x.row(first + r);
                let to = block.iter_mut().skip(r).step_by(rows);
                for (to, &value) in to.zip(row) {
                    finite &= value.is_finite();
                    *to = value;
                }
            }
            for (column, &(lower, upper)) in block.chunks_exact_mut(rows).zip(&self.input_bounds) {
                column.iter_mut().for_each(|x| *x = x.max(lower).min(upper));
            }
            if let Some(scaler) = &self.scaler {
                scaler.transform_columns(block.chunks_exact_mut(rows));
            }
        }
        if finite {
            return Ok(());
        }
        let place = x.indexed_iter().find(|(_, value)| !value.is_finite());
        let (row, column) = place.map_or((0, 0), |(place, _)| place);
        Err(Error::NotFinite {
            what: "inputs",
            row: offset + row,
            column,
        })
    }

    fn activate(&self, group: &Panels<A>, hidden: &mut [A], first_panel: usize, panels: usize) {
        let apply = |values: &mut [A]| {
            let function = &group.activation;
            function.apply_to_slice(self.level, self.accuracy, values);
        };
        let Some(used) = group.used(first_panel, panels) else {
            return apply(hidden);
        };
        for row in hidden.chunks_exact_mut(panels * A::LINE) {
            let (neurons, filling) = row.split_at_mut(used);
            apply(neurons);
            filling.fill(A::zero());
        }
    }
}

impl<A: Scalar> TileBuffers<A> {
    /// The lengths of the buffers: inputs, scaled, hidden.
    pub(crate) fn lengths(&self) -> [usize; 3] {
        [&self.inputs, &self.scaled, &self.hidden].map(|part| part.as_slice().len())
    }
}

/// Multiplies inputs, in blocks of rows, by the scale of each.
fn multiply<A: Scalar>(inputs: &[A], scales: &[A], rows: usize, to: &mut [A]) {
    for (first, block) in row_blocks(rows) {
        let part = first * scales.len()..(first + block) * scales.len();
        let from = inputs[part.clone()].chunks_exact(block);
        let to = to[part].chunks_exact_mut(block);
        for ((from, to), &scale) in from.zip(to).zip(scales) {
            to.iter_mut().zip(from).for_each(|(to, &x)| *to = x * scale);
        }
    }
}

/// The rows of a tile of inputs, which lies in blocks of rows: (row, its inputs).
pub(crate) fn tile_rows<A: Scalar>(
    x: &[A],
    inputs: usize,
    rows: usize,
) -> impl Iterator<Item = (usize, impl Iterator<Item = A>)> {
    row_blocks(rows).flat_map(move |(first, block_rows)| {
        let block = &x[first * inputs..(first + block_rows) * inputs];
        (0..block_rows).map(move |r| {
            let values = block.iter().skip(r).step_by(block_rows).copied();
            (first + r, values)
        })
    })
}
