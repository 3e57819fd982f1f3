//! Samples a piecewise constant density on the unit square.

/// A density that is constant on each cell of a grid over $[0, 1]^2$.
#[derive(Debug, Clone)]
pub(crate) struct Distribution2 {
    columns: usize,
    rows: usize,
    /// Probability of everything before the end of each row.
    marginal: Vec<f64>,
    /// For each row, probability within the row of everything before the end of each cell.
    conditional: Vec<f64>,
}

impl Distribution2 {
    /// From weights of cells, row by row; uniform where no weight is positive and finite.
    pub(crate) fn new(columns: usize, weights: &[f64]) -> Self {
        let rows = weights.len() / columns;
        let mut conditional = weights.to_vec();
        let mut marginal: Vec<f64> = conditional
            .chunks_exact_mut(columns)
            .map(accumulate)
            .collect();
        accumulate(&mut marginal);
        Self {
            columns,
            rows,
            marginal,
            conditional,
        }
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.conditional[row * self.columns..(row + 1) * self.columns]
    }

    /// The point (across, down) that uniform numbers stand for, and its density.
    pub(crate) fn sample(&self, [a, b]: [f64; 2]) -> ([f64; 2], f64) {
        let (row, y, p) = invert(&self.marginal, b);
        let (column, x, q) = invert(self.row(row), a);
        let point = [
            (column as f64 + x) / self.columns as f64,
            (row as f64 + y) / self.rows as f64,
        ];
        (point, p * q * (self.columns * self.rows) as f64)
    }

    /// The density at a point.
    pub(crate) fn density(&self, [x, y]: [f64; 2]) -> f64 {
        let cell = |at: f64, cells: usize| ((at * cells as f64) as usize).min(cells - 1);
        let row = cell(y, self.rows);
        let p = probability(&self.marginal, row);
        let q = probability(self.row(row), cell(x, self.columns));
        p * q * (self.columns * self.rows) as f64
    }
}

/// Turns weights into cumulative probabilities and returns their sum.
fn accumulate(weights: &mut [f64]) -> f64 {
    let usable = |w: f64| if w > 0.0 && w.is_finite() { w } else { 0.0 };
    let total: f64 = weights.iter().copied().map(usable).sum();
    let count = weights.len() as f64;
    let mut sum = 0.0;
    for (index, weight) in weights.iter_mut().enumerate() {
        sum += usable(*weight);
        *weight = if total > 0.0 {
            sum / total
        } else {
            (index + 1) as f64 / count
        };
    }
    if let Some(last) = weights.last_mut() {
        *last = 1.0;
    }
    total
}

fn probability(cumulative: &[f64], cell: usize) -> f64 {
    cumulative[cell] - cell.checked_sub(1).map_or(0.0, |before| cumulative[before])
}

/// The cell that `u` falls in, how far into it, and its probability.
fn invert(cumulative: &[f64], u: f64) -> (usize, f64, f64) {
    let cell = cumulative
        .partition_point(|&end| end <= u)
        .min(cumulative.len() - 1);
    let p = probability(cumulative, cell);
    let start = cumulative[cell] - p;
    let within = if p > 0.0 { (u - start) / p } else { 0.5 };
    // Below 1, so that the point lies in its own cell.
    (cell, within.clamp(0.0, 1.0 - f64::EPSILON), p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_fall_in_proportion_to_the_weights() {
        let weights = [1.0, 0.0, 3.0, 2.0, 2.0, 0.0];
        let d = Distribution2::new(3, &weights);
        let mut counts = [0.0; 6];
        let n = 400;
        for i in 0..n {
            for j in 0..n {
                let u = [(i as f64 + 0.5) / n as f64, (j as f64 + 0.5) / n as f64];
                let ([x, y], density) = d.sample(u);
                assert!((density - d.density([x, y])).abs() < 1e-12);
                counts[(y * 2.0) as usize * 3 + (x * 3.0) as usize] += 1.0 / (n * n) as f64;
            }
        }
        // A regular grid of numbers misses a cell's probability by less than its boundary.
        for (count, weight) in counts.iter().zip(weights) {
            assert!((count - weight / 8.0).abs() < 2.0 / n as f64, "{counts:?}");
        }
    }

    #[test]
    fn without_a_usable_weight_it_is_uniform() {
        for weight in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let d = Distribution2::new(2, &[weight; 6]);
            assert!((d.density([0.3, 0.9]) - 1.0).abs() < 1e-12);
        }
    }
}
