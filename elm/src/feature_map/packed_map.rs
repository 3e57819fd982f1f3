//! A feature map packed for evaluation, tile by tile.

use ndarray::{ArrayView2, Axis};

use super::FeatureMap;
use super::kernels::{Project, row_blocks};
use super::layer::NeuronBlock;
use super::neurons::NodeType;
use super::packed::{CHUNK_PANELS, Packed, Panels};
use super::ramp_tables::{Place, ProjectRamps, RampTables};
use super::ramps::Ramps;
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
    ramps: Option<Ramps<A>>,
    /// Where weighted sums come from in place of packed weights.
    pub(crate) tables: Option<RampTables<A>>,
    /// Number of inputs, before they are embedded.
    pub(crate) inputs: usize,
    /// What each input is held between; empty where they are not.
    input_bounds: Vec<(A, A)>,
    pub(crate) accuracy: Accuracy,
    pub(crate) level: Level,
}

/// Working memory for a tile of rows.
#[derive(Debug, Clone)]
pub(crate) struct TileBuffers<A: Scalar> {
    /// Inputs as neurons see them, as [`Project`] wants them.
    pub(crate) inputs: Aligned<A>,
    /// The same, multiplied by the scales of a group of radial neurons.
    scaled: Aligned<A>,
    /// One chunk of the hidden layer.
    pub(crate) hidden: Aligned<A>,
    /// Of the rows one after the other where they lie along each input; for tables alone.
    places: Vec<Place<A>>,
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
        let (packed, _) = Packed::new(map.layer(), beta, true);
        Self::of(map, packed, None, input_bounds)
    }

    /// For predictions: with ramps, weighted sums come from tables, and those of direct links with them.
    pub(crate) fn for_prediction(
        map: &FeatureMap<A>,
        beta: ArrayView2<'_, A>,
        input_bounds: Vec<(A, A)>,
    ) -> Self {
        let layer = map.layer();
        let radial = |group: &NeuronBlock<A>| group.node_type() == NodeType::Rbf;
        let Some(ramps) = map.ramps().filter(|_| !layer.groups().iter().any(radial)) else {
            return Self::new(map, beta, input_bounds);
        };
        let (own, links) = beta.split_at(Axis(0), layer.neurons());
        let (packed, places) = Packed::new(layer, own, false);
        let tables = RampTables::new(map, ramps, &places, packed.panels, links);
        Self::of(map, packed, Some(tables), input_bounds)
    }

    fn of(
        map: &FeatureMap<A>,
        packed: Packed<A>,
        tables: Option<RampTables<A>>,
        input_bounds: Vec<(A, A)>,
    ) -> Self {
        Self {
            packed,
            tables,
            scaler: map.scaler().cloned(),
            ramps: map.ramps().cloned(),
            inputs: map.inputs(),
            input_bounds,
            accuracy: Accuracy::Full,
            level: Level::best(),
        }
    }

    /// Lengths of the buffers: inputs, scaled, hidden, places.
    pub(crate) fn lengths(&self) -> [usize; 4] {
        let groups = &self.packed.groups;
        let neurons = groups.iter().map(|group| group.count);
        let links = match &self.tables {
            None => self.packed.link_panels,
            Some(tables) => tables.link_panels(),
        };
        let panels = neurons.chain([links]).max().unwrap_or(0);
        let radial = groups.iter().any(|group| group.radial.is_some());
        let inputs = TILE_ROWS * self.packed.inputs;
        let (inputs, places) = match &self.tables {
            None => (inputs, 0),
            Some(tables) => (0, TILE_ROWS * tables.inputs()),
        };
        [
            inputs,
            if radial { inputs } else { 0 },
            TILE_ROWS * panels.min(CHUNK_PANELS) * A::LINE,
            places,
        ]
    }

    pub(crate) fn buffers(&self) -> TileBuffers<A> {
        let [inputs, scaled, hidden, places] = self.lengths();
        TileBuffers {
            inputs: zeros(inputs),
            scaled: zeros(scaled),
            hidden: zeros(hidden),
            places: vec![(0, A::zero()); places],
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
        if let Some(tables) = &self.tables {
            return self.tile_by_tables(tables, x, offset, buffers, take);
        }
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

    /// As [`tile`](Self::tile), row by row.
    fn tile_by_tables(
        &self,
        tables: &RampTables<A>,
        x: ArrayView2<'_, A>,
        offset: usize,
        buffers: &mut TileBuffers<A>,
        mut take: impl FnMut(Chunk<'_, A>),
    ) -> Result<()> {
        let rows = x.nrows();
        let finite = x.iter().all(|value| value.is_finite());
        if !finite {
            return Err(not_finite(x, offset));
        }
        let places = buffers.places.chunks_exact_mut(tables.inputs());
        for (x, places) in x.rows().into_iter().zip(places) {
            let held = |(input, &x): (usize, &A)| match self.input_bounds.get(input) {
                Some(&(lower, upper)) => x.max(lower).min(upper),
                None => x,
            };
            tables.locate(x.iter().enumerate().map(held), places);
        }
        for group in &self.packed.groups {
            let end = group.first + group.count;
            for first_panel in (group.first..end).step_by(CHUNK_PANELS) {
                let panels = CHUNK_PANELS.min(end - first_panel);
                let hidden = &mut buffers.hidden[..rows * panels * A::LINE];
                self.project(tables, &buffers.places, first_panel, panels, hidden);
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

    fn project(
        &self,
        tables: &RampTables<A>,
        places: &[Place<A>],
        first_panel: usize,
        panels: usize,
        hidden: &mut [A],
    ) {
        let rows = places.chunks_exact(tables.inputs());
        for (places, hidden) in rows.zip(hidden.chunks_exact_mut(panels * A::LINE)) {
            self.level.run(ProjectRamps {
                tables,
                places,
                first_panel,
                hidden,
            });
        }
    }

    /// Adds what direct links make of the rows that were [evaluated](Self::tile) last, where tables know:
    /// `sums` has a line for each row and output.
    pub(crate) fn add_links(&self, rows: usize, buffers: &mut TileBuffers<A>, sums: &mut [A]) {
        let Some(tables) = &self.tables else {
            return;
        };
        let outputs = self.packed.outputs;
        for first in (0..tables.link_panels()).step_by(CHUNK_PANELS) {
            let panels = CHUNK_PANELS.min(tables.link_panels() - first);
            let hidden = &mut buffers.hidden[..rows * panels * A::LINE];
            self.project(
                tables,
                &buffers.places,
                tables.panels + first,
                panels,
                hidden,
            );
            let links = hidden.chunks_exact(panels * A::LINE);
            for (links, sums) in links.zip(sums.chunks_exact_mut(outputs * A::LINE)) {
                let sums = sums.iter_mut().step_by(A::LINE).skip(first * A::LINE);
                sums.zip(links).for_each(|(sum, &link)| *sum += link);
            }
        }
    }

    /// Copies a tile of inputs, standardized and beside their ramps, into blocks of rows.
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
            let (block, embedded) = block.split_at_mut(self.inputs * rows);
            if let Some(ramps) = &self.ramps {
                let columns = embedded.chunks_exact_mut(rows);
                ramps.write(block.chunks_exact(rows), columns);
            }
            if let Some(scaler) = &self.scaler {
                scaler.transform_columns(block.chunks_exact_mut(rows));
            }
        }
        if finite {
            return Ok(());
        }
        Err(not_finite(x, offset))
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
    /// The lengths of the buffers: inputs, scaled, hidden, places.
    pub(crate) fn lengths(&self) -> [usize; 4] {
        let [inputs, scaled, hidden] =
            [&self.inputs, &self.scaled, &self.hidden].map(|part| part.as_slice().len());
        [inputs, scaled, hidden, self.places.len()]
    }
}

/// The first value of a tile that is not finite, which is there.
fn not_finite<A: Scalar>(x: ArrayView2<'_, A>, offset: usize) -> Error {
    let place = x.indexed_iter().find(|(_, value)| !value.is_finite());
    let (row, column) = place.map_or((0, 0), |(place, _)| place);
    Error::NotFinite {
        what: "inputs",
        row: offset + row,
        column,
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
