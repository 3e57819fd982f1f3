//! Sums of products of all columns, hidden and target, over rows that exist a tile at a time.
//!
//! Columns are taken less a value near their mean, so that centering them for an intercept is a
//! small correction afterwards (Chan, Golub and LeVeque, Algorithms for Computing the Sample
//! Variance, 1983, section 3, for one column); the correction's size is known, and with it what
//! it costs in digits.

use std::ops::Range;

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, ShapeBuilder, s};

use super::equilibration::{Equilibration, magnitudes, weighted_magnitudes};
use crate::error::Result;
use crate::feature_map::{FeatureRows, TileBuffers};
use crate::scalar::{Scalar, power_of_two};
use crate::threads;

/// Where the rows of a hidden-layer matrix come from.
pub(crate) enum HiddenRows<'a, A: Scalar> {
    /// From the inputs, as they are needed.
    Map(Box<FeatureRows<'a, A>>),
    /// From the matrix itself.
    Matrix(ArrayView2<'a, A>),
}

impl<A: Scalar> HiddenRows<'_, A> {
    fn rows(&self) -> usize {
        match self {
            Self::Map(layer) => layer.rows(),
            Self::Matrix(matrix) => matrix.nrows(),
        }
    }

    fn columns(&self) -> usize {
        match self {
            Self::Map(layer) => layer.columns(),
            Self::Matrix(matrix) => matrix.ncols(),
        }
    }

    /// A power of two that brings the matrix into the middle of the range. The values of a layer
    /// are there already, or its sums are found to be out of range.
    fn scale(&self, root_weights: &Array1<A>) -> A {
        match self {
            Self::Map(_) => A::one(),
            Self::Matrix(matrix) => {
                let largest = weighted_magnitudes(*matrix, root_weights);
                power_of_two(largest.iter().fold(A::zero(), |m, x| m.max(*x)))
            }
        }
    }

    /// As [`scale`](Self::scale), by weights in `f64`.
    pub(super) fn scale_wide(&self, root_weights: &Array1<f64>) -> f64 {
        match self {
            Self::Map(_) => 1.0,
            Self::Matrix(matrix) => {
                let largest = magnitudes(*matrix, root_weights);
                power_of_two(largest.iter().fold(0.0, |m: f64, x| m.max(*x)))
            }
        }
    }

    /// Working memory for [`write`](Self::write).
    pub(super) fn buffers(&self) -> Option<TileBuffers<A>> {
        match self {
            Self::Map(layer) => Some(layer.buffers()),
            Self::Matrix(_) => None,
        }
    }

    /// Writes rows divided by `scale`, less `shift`, each to the beginning of a line of `stride` values.
    pub(super) fn write(
        &self,
        rows: Range<usize>,
        (scale, shift): (A, &[A]),
        (to, stride): (&mut [A], usize),
        buffers: &mut Option<TileBuffers<A>>,
    ) -> Result<()> {
        match self {
            Self::Map(layer) => {
                let buffers = buffers.get_or_insert_with(|| layer.buffers());
                layer.write(rows, shift, (to, stride), buffers)?;
            }
            Self::Matrix(matrix) => {
                let rows = matrix.slice(s![rows, ..]);
                for (row, to) in rows.rows().into_iter().zip(to.chunks_mut(stride)) {
                    for ((to, &value), &shift) in to.iter_mut().zip(row).zip(shift) {
                        *to = value / scale - shift;
                    }
                }
            }
        }
        Ok(())
    }
}

/// The rows of a problem, whose hidden part need not exist yet.
pub(crate) struct RowSource<'a, A: Scalar> {
    pub(crate) hidden: HiddenRows<'a, A>,
    pub(crate) targets: ArrayView2<'a, A>,
    pub(crate) weights: Option<ArrayView1<'a, A>>,
    pub(crate) intercept: bool,
}

/// Bytes in a tile: it stays in the second-level or third-level cache between being written and
/// being multiplied, and has enough rows that adding its product to the sums costs little.
const TILE_BYTES: usize = 1 << 21;
/// Rows for a first guess at the means, and the places that they come from.
const SAMPLE: usize = 256;
const RUNS: usize = 64;

impl<A: Scalar> RowSource<'_, A> {
    pub(crate) fn rows(&self) -> usize {
        self.hidden.rows()
    }

    pub(crate) fn neurons(&self) -> usize {
        self.hidden.columns()
    }

    pub(super) fn outputs(&self) -> usize {
        self.targets.ncols()
    }

    /// Of a row of a tile: hidden values, targets, and a one where there is an intercept.
    pub(super) fn width(&self) -> usize {
        self.neurons() + self.outputs() + usize::from(self.intercept)
    }

    fn tile_rows(&self) -> usize {
        let rows = TILE_BYTES / size_of::<A>() / self.width();
        rows.clamp(64, 1024).min(self.rows())
    }

    /// Parts of the rows whose sums are taken by themselves, on whatever thread, and then added in their
    /// order.
    pub(super) fn parts(&self) -> Vec<Range<usize>> {
        /// Parts of this size cost far more than adding their sums does.
        const ROWS: usize = 1024;
        const MOST: usize = 16;
        /// Numbers in the sums of all parts.
        const ROOM: usize = 1 << 24;
        let room = ROOM / self.width().saturating_mul(self.width()).max(1);
        threads::split(self.rows(), (self.rows() / ROWS).min(MOST).min(room))
    }

    /// Writes a tile: rows divided by their scales and less `shift`, all times the root of the
    /// row's weight. A row of weight 0 may hold anything, even what overflows; it becomes 0.
    fn write(
        &self,
        rows: Range<usize>,
        (frame, shift): (&Equilibration<A>, &[A]),
        to: &mut [A],
        buffers: &mut Option<TileBuffers<A>>,
    ) -> Result<()> {
        let (neurons, width) = (self.neurons(), self.width());
        let (hidden_shift, target_shift) = shift.split_at(neurons);
        let scale = frame.hidden_scale;
        self.hidden
            .write(rows.clone(), (scale, hidden_shift), (to, width), buffers)?;
        let targets = self.targets.slice(s![rows.clone(), ..]);
        let roots = frame.root_weights.slice(s![rows]);
        for ((to, targets), &root) in to.chunks_exact_mut(width).zip(targets.rows()).zip(roots) {
            if root == A::zero() {
                to.fill(A::zero());
                continue;
            }
            let rest = &mut to[neurons..];
            for (((to, &target), &scale), &shift) in rest
                .iter_mut()
                .zip(targets)
                .zip(&frame.target_scale)
                .zip(target_shift)
            {
                *to = target / scale - shift;
            }
            if self.intercept {
                to[width - 1] = A::one();
            }
            if root != A::one() {
                to.iter_mut().for_each(|value| *value *= root);
            }
        }
        Ok(())
    }
}

/// A problem as its normal equations: rows weighted, columns centered where there is an intercept.
pub(crate) struct NormalEquations<A: Scalar> {
    /// $\tilde H^T \tilde H$, the lower half, by columns.
    pub(crate) gram: Array2<A>,
    /// $\tilde H^T \tilde T$.
    pub(crate) right: Array2<A>,
    /// The sum of squares of each column of $\tilde T$.
    pub(crate) squares: Array1<A>,
    /// What centering took out of the sums, as a share of the smallest thing that it may matter
    /// beside: $n \lVert \delta \rVert^2$ for $\delta$ the distance of the means from where the columns
    /// were shifted to.
    pub(crate) correction: A,
    pub(crate) frame: Equilibration<A>,
    /// What was taken off hidden and target columns, these in units of their scale.
    shift: Vec<A>,
}

impl<A: Scalar> NormalEquations<A> {
    /// Adds up all rows.
    ///
    /// # Errors
    /// Those of making the rows.
    pub(crate) fn gather(source: &RowSource<'_, A>) -> Result<Self> {
        let (rows, neurons, outputs) = (source.rows(), source.neurons(), source.outputs());
        let mut frame = Equilibration::of_weights(rows, source.weights.as_ref(), source.intercept);
        frame.target_scale =
            weighted_magnitudes(source.targets, &frame.root_weights).mapv_into(power_of_two);
        frame.hidden_scale = source.hidden.scale(&frame.root_weights);
        frame.hidden_mean = Array1::zeros(neurons);
        frame.target_mean = Array1::zeros(outputs);

        let (width, tile_rows) = (source.width(), source.tile_rows());
        let mut shift = vec![A::zero(); neurons + outputs];
        if source.intercept && rows <= tile_rows {
            // All rows at once: made once, and shifted then.
            let mut tile = vec![A::zero(); rows * width];
            source.write(0..rows, (&frame, &shift), &mut tile, &mut None)?;
            let roots = &frame.root_weights;
            shift = center_of(&tile, width, roots);
            for (row, &root) in tile.chunks_exact_mut(width).zip(roots) {
                for (value, &shift) in row.iter_mut().zip(&shift) {
                    *value -= shift * root;
                }
            }
            let mut sums = Array2::zeros((width, width).f());
            if let Ok(tile) = ArrayView2::from_shape((rows, width), &tile) {
                A::add_gram(tile, &mut sums, &mut Vec::new());
            }
            return Ok(Self::of_sums(&sums, frame, shift));
        }
        if source.intercept {
            // Of rows from everywhere, as the first may be unlike the rest.
            let mut sample = vec![A::zero(); SAMPLE.min(tile_rows) * width];
            let mut roots = Vec::with_capacity(SAMPLE);
            let mut buffers = source.hidden.buffers();
            for run in spread_runs(rows, SAMPLE.min(tile_rows)) {
                let to = &mut sample[roots.len() * width..][..run.len() * width];
                source.write(run.clone(), (&frame, &shift), to, &mut buffers)?;
                roots.extend(frame.root_weights.slice(s![run]));
            }
            shift = center_of(&sample, width, &Array1::from(roots));
        }
        let zeros = || Array2::zeros((width, width).f());
        let memory = || {
            let tile = vec![A::zero(); tile_rows * width];
            (tile, source.hidden.buffers(), Vec::new())
        };
        let sums = threads::sum(source.parts(), zeros, memory, |memory, part, sums| {
            let (tile, buffers, scratch) = memory;
            for range in runs(part, tile_rows) {
                let tile = &mut tile[..range.len() * width];
                source.write(range, (&frame, &shift), tile, buffers)?;
                if let Ok(tile) = ArrayView2::from_shape((tile.len() / width, width), tile) {
                    A::add_gram(tile, sums, scratch);
                }
            }
            Ok(())
        })?;
        let sums = sums.unwrap_or_else(zeros);
        Ok(Self::of_sums(&sums, frame, shift))
    }

    pub(super) fn of_sums(sums: &Array2<A>, mut frame: Equilibration<A>, shift: Vec<A>) -> Self {
        let (neurons, outputs) = (frame.hidden_mean.len(), frame.target_mean.len());
        let mut gram = Array2::zeros((neurons, neurons).f());
        gram.assign(&sums.slice(s![..neurons, ..neurons]));
        let targets = neurons..neurons + outputs;
        let mut right = sums.slice(s![targets.clone(), ..neurons]).t().to_owned();
        let mut squares = sums.diag().slice(s![targets.clone()]).to_owned();
        let mut correction = A::zero();
        if frame.intercept {
            let totals = sums.row(neurons + outputs);
            // The distance of the mean from the shift; the number of rows is a sum, too.
            let distance = &totals.slice(s![..neurons + outputs]) / frame.total_weight;
            let (hidden, target) = distance.view().split_at(Axis(0), neurons);
            for (j, mut column) in gram.columns_mut().into_iter().enumerate() {
                let factor = hidden[j] * frame.total_weight;
                let mut below = column.slice_mut(s![j..]);
                below.scaled_add(-factor, &hidden.slice(s![j..]));
            }
            for (mut column, &target) in right.columns_mut().into_iter().zip(target) {
                column.scaled_add(-target * frame.total_weight, &hidden);
            }
            squares.scaled_add(-frame.total_weight, &target.mapv(|t| t * t));
            correction = hidden.dot(&hidden) * frame.total_weight;
            let mean = &ArrayView1::from(&shift) + &distance;
            let (hidden, target) = mean.view().split_at(Axis(0), neurons);
            frame.hidden_mean = &hidden * frame.hidden_scale;
            frame.target_mean = &target * &frame.target_scale;
        }
        Self {
            gram,
            right,
            squares: squares.mapv_into(|s| s.max(A::zero())),
            correction,
            frame,
            shift,
        }
    }

    /// Of columns that are centered already, where there is an intercept.
    pub(crate) fn of_centered(
        gram: Array2<A>,
        right: Array2<A>,
        squares: Array1<A>,
        frame: Equilibration<A>,
    ) -> Self {
        Self {
            gram,
            right,
            squares,
            correction: A::zero(),
            frame,
            shift: Vec::new(),
        }
    }

    /// Whether the sums are those of numbers in the middle of the type's range.
    pub(crate) fn in_range(&self) -> bool {
        let bound = A::max_value().sqrt();
        let largest = self
            .gram
            .diag()
            .fold(A::zero(), |m, &d| if d > m { d } else { m });
        let finite = |d: &A| d.is_finite();
        largest < bound
            && largest > bound.recip()
            && self.gram.diag().iter().all(finite)
            && self.right.iter().all(finite)
            && self.squares.iter().all(finite)
    }

    /// The squared norm of the residual of each output with these weights (of the scaled problem),
    /// from the rows themselves: one more pass, without the sums of products.
    ///
    /// # Errors
    /// Those of making the rows.
    pub(crate) fn residual_squares(
        &self,
        source: &RowSource<'_, A>,
        beta: &Array2<A>,
    ) -> Result<Array1<A>> {
        let (neurons, outputs) = (source.neurons(), source.outputs());
        let (width, tile_rows) = (source.width(), source.tile_rows());
        // What the shifted rows are still short of being centered.
        let scaled = &self.frame.target_mean / &self.frame.target_scale;
        let constant = if self.frame.intercept {
            let hidden = &self.frame.hidden_mean / self.frame.hidden_scale
                - ArrayView1::from(&self.shift[..neurons]);
            scaled - ArrayView1::from(&self.shift[neurons..]) - hidden.dot(beta)
        } else {
            Array1::zeros(outputs)
        };
        let squares_of = |part: Range<usize>| {
            let mut tile = vec![A::zero(); tile_rows * width];
            let mut squares = Array1::zeros(outputs);
            let mut buffers = source.hidden.buffers();
            for range in runs(part, tile_rows) {
                let tile = &mut tile[..range.len() * width];
                let place = (&self.frame, self.shift.as_slice());
                source.write(range.clone(), place, tile, &mut buffers)?;
                let Ok(tile) = ArrayView2::from_shape((range.len(), width), tile) else {
                    continue;
                };
                let fitted = A::product(tile.slice(s![.., ..neurons]), beta.view());
                let targets = tile.slice(s![.., neurons..neurons + outputs]);
                let roots = self.frame.root_weights.slice(s![range]);
                let rows = fitted.rows().into_iter().zip(targets.rows()).zip(roots);
                for ((fitted, targets), &root) in rows {
                    let columns = squares.iter_mut().zip(fitted).zip(targets).zip(&constant);
                    for (((sum, &f), &t), &c) in columns {
                        let rest = t - f - c * root;
                        *sum += rest * rest;
                    }
                }
            }
            Ok(squares)
        };
        let squares = threads::reduce(source.parts(), squares_of, |sum, part| *sum += &part)?;
        Ok(squares.unwrap_or_else(|| Array1::zeros(outputs)))
    }
}

/// Ranges of up to `length` rows, from the first to the last of `rows`.
pub(super) fn runs(rows: Range<usize>, length: usize) -> impl Iterator<Item = Range<usize>> {
    let end = rows.end;
    rows.step_by(length)
        .map(move |first| first..end.min(first + length))
}

/// About `wanted` of `rows` rows, as runs of equal length spread evenly from first to last.
pub(super) fn spread_runs(rows: usize, wanted: usize) -> impl Iterator<Item = Range<usize>> {
    let runs = RUNS.min(wanted);
    let length = wanted / runs;
    let last = rows - length;
    (0..runs).map(move |run| {
        let first = (last as u128 * run as u128 / (runs.max(2) - 1) as u128) as usize;
        first..first + length
    })
}

/// A value near each column's weighted mean over a tile that has not been shifted; for a column that
/// is constant there, its value to the last bit, so that what is left of it is 0. The last column,
/// of ones, is left out.
pub(super) fn center_of<A: Scalar>(tile: &[A], width: usize, roots: &Array1<A>) -> Vec<A> {
    let mut rows = tile
        .chunks_exact(width)
        .zip(roots)
        .filter(|(_, root)| **root > A::zero());
    let mut sums = vec![A::zero(); width - 1];
    let Some((first, &first_root)) = rows.next() else {
        return sums;
    };
    let mut total = first_root * first_root;
    let first: Vec<A> = first.iter().map(|&value| value / first_root).collect();
    for (row, &root) in rows {
        let weight = root * root;
        total += weight;
        let columns = sums.iter_mut().zip(row).zip(&first);
        if root == A::one() {
            columns.for_each(|((sum, &value), &first)| *sum += value - first);
        } else {
            columns.for_each(|((sum, &value), &first)| *sum += weight * (value / root - first));
        }
    }
    let value = |(&sum, &first): (&A, &A)| first + sum / total;
    sums.iter().zip(&first).map(value).collect()
}

#[cfg(test)]
mod tests {
    use ndarray::{Array1, Array2};

    use super::{HiddenRows, NormalEquations, RowSource, spread_runs};

    #[test]
    fn runs_are_spread_over_all_rows_and_hold_as_many_as_wanted() {
        for (rows, wanted) in [(9, 8), (100, 90), (1001, 1000), (20_000, 256)] {
            let runs: Vec<_> = spread_runs(rows, wanted).collect();
            let held: usize = runs.iter().map(ExactSizeIterator::len).sum();
            assert!(held <= wanted && 2 * held > wanted);
            assert_eq!((runs[0].start, runs[runs.len() - 1].end), (0, rows));
        }
    }

    #[test]
    fn columns_are_shifted_near_their_weighted_means_whatever_the_order_of_the_rows() {
        // Sorted rows, the last of which count a thousand times as much as the first.
        let rows = 30_000;
        let place = |row: usize| row as f64 / rows as f64;
        let hidden = Array2::from_shape_fn((rows, 3), |(row, j)| (place(row) + j as f64).sin());
        let targets = Array2::from_shape_fn((rows, 1), |(row, _)| place(row));
        let weights = Array1::from_shape_fn(rows, |row| 1000.0_f64.powf(place(row)));
        let source = RowSource {
            hidden: HiddenRows::Matrix(hidden.view()),
            targets: targets.view(),
            weights: Some(weights.view()),
            intercept: true,
        };
        let moments = NormalEquations::gather(&source).unwrap();
        let largest = moments.gram.diag().fold(0.0, |m: f64, &d| m.max(d));
        assert!(moments.correction < 0.01 * largest);
    }
}
