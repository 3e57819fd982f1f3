//! Interpolation on the unit square, and the map from it to itself that evens a density out.
//!
//! A table of `width` x `height` numbers stands for the function that is bilinear between them,
//! the corners of the square being those of the table. The first coordinate runs along a row.

use std::f64::consts::TAU;

/// Two slices along a parameter, with their weights.
pub(super) type Pair = [(usize, f64); 2];
/// Two table slices along each of the two parameters, with their weights.
pub(super) type Blend = [(usize, f64); 4];

/// Increasing values of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis(pub(super) Vec<f64>);

impl Axis {
    /// The values around `x` and their weights; beyond the ends the value there.
    pub(super) fn around(&self, x: f64) -> Pair {
        let Self(values) = self;
        let after = values.partition_point(|&value| value <= x);
        let left = after.saturating_sub(1).min(values.len().saturating_sub(2));
        match values.get(left..left + 2) {
            Some(&[a, b]) => {
                let weight = ((x - a) / (b - a)).clamp(0.0, 1.0);
                [(left, 1.0 - weight), (left + 1, weight)]
            }
            _ => [(0, 1.0), (0, 0.0)],
        }
    }

    /// The same of a parameter that goes round: after the last value comes the first, a turn later.
    pub(super) fn around_a_turn(&self, x: f64) -> Pair {
        match self.0.as_slice() {
            [first, .., last] if x > *last && first + TAU > *last => {
                let weight = ((x - last) / (first + TAU - last)).clamp(0.0, 1.0);
                [(self.0.len() - 1, 1.0 - weight), (0, weight)]
            }
            _ => self.around(x),
        }
    }

    /// The slices around a point of two parameters, of which the second runs faster.
    pub(super) fn blend([a, b]: Pair, second: &Self, y: f64) -> Blend {
        let [c, d] = second.around(y);
        [(a, c), (a, d), (b, c), (b, d)].map(|((i, u), (j, v))| (i * second.0.len() + j, u * v))
    }
}

/// The size of a table, at least 2 x 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size {
    pub(super) width: usize,
    pub(super) height: usize,
}

/// A place in a table: the corner before it and the shares of the way to the next.
#[derive(Clone, Copy)]
struct Place {
    column: usize,
    row: usize,
    x: f64,
    y: f64,
}

impl Size {
    pub(super) fn area(self) -> usize {
        self.width * self.height
    }

    fn place(self, [x, y]: [f64; 2]) -> Place {
        let ((column, x), (row, y)) = (split(x, self.width), split(y, self.height));
        Place { column, row, x, y }
    }

    /// The bilinear interpolant of a table at a point of the unit square.
    pub(super) fn interpolate(self, table: &[f32], point: [f64; 2]) -> f64 {
        self.bilinear(point, |index| number(table, index))
    }

    /// As [`interpolate`](Self::interpolate), of numbers by their place in a table.
    fn bilinear(self, point: [f64; 2], number: impl Fn(usize) -> f64) -> f64 {
        let Place { column, row, x, y } = self.place(point);
        let at = |c: usize, r: usize| number((row + r) * self.width + column + c);
        mix(y, mix(x, at(0, 0), at(1, 0)), mix(x, at(0, 1), at(1, 1)))
    }
}

#[allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss
)]
fn split(x: f64, size: usize) -> (usize, f64) {
    let along = x.clamp(0.0, 1.0) * (size - 1) as f64;
    // The cast takes NaN to 0; the share stays NaN.
    let step = (along as usize).min(size - 2);
    (step, along - step as f64)
}

fn number(table: &[f32], index: usize) -> f64 {
    table.get(index).copied().map_or(f64::NAN, f64::from)
}

fn mix(share: f64, a: f64, b: f64) -> f64 {
    a + share * (b - a)
}

/// The map that takes a density on the unit square, one for each pair of parameters, to the
/// uniform one: first along the columns' total, then along each row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Warp {
    size: Size,
    /// Per slice the density at each point, with integral 1 in units of the table's cells.
    density: Vec<f64>,
    /// Per slice and row the integral of the density from the row's begin to each point.
    along_row: Vec<f64>,
    /// Per slice the integral of all rows' integrals from the first to each row.
    across_rows: Vec<f64>,
}

impl Warp {
    /// From tables of this size, one after another, of numbers that are not negative; the index
    /// of the first slice that is zero everywhere, or too large, is the error.
    pub(super) fn new(size: Size, tables: impl Iterator<Item = f32>) -> Result<Self, usize> {
        let mut density: Vec<f64> = tables.map(f64::from).collect();
        let mut along_row = Vec::with_capacity(density.len());
        let mut across_rows = Vec::with_capacity(density.len() / size.width);
        for (index, slice) in density.chunks_exact_mut(size.area()).enumerate() {
            let mut totals = Vec::with_capacity(size.height);
            let row_begin = along_row.len();
            for row in slice.chunks_exact(size.width) {
                totals.push(cumulate(row, &mut along_row));
            }
            let slice_begin = across_rows.len();
            let total = cumulate(&totals, &mut across_rows);
            if !(total > 0.0 && total.is_finite()) {
                return Err(index);
            }
            let parts = [
                slice,
                &mut along_row[row_begin..],
                &mut across_rows[slice_begin..],
            ];
            for number in parts.into_iter().flatten() {
                *number /= total;
            }
        }
        Ok(Self {
            size,
            density,
            along_row,
            across_rows,
        })
    }

    /// Where a point of the unit square goes, under the weighted mean of the slices' densities.
    ///
    /// Within a cell the density is bilinear, so that its integrals are quadratic: over the share
    /// `s` of a step between `a` and `b` it is $s (a + s (b - a) / 2)$.
    pub(super) fn flatten(&self, blend: &Blend, point: [f64; 2]) -> [f64; 2] {
        let Place { column, row, x, y } = self.size.place(point);
        let (width, height) = (self.size.width, self.size.height);
        let at = |table: &[f64], column: usize, row: usize| {
            let sum = blend.iter().map(|&(slice, weight)| {
                let index = (slice * height + row) * width + column;
                weight * table.get(index).copied().unwrap_or(f64::NAN)
            });
            sum.sum::<f64>()
        };
        let between_rows =
            |table: &[f64], column| mix(y, at(table, column, row), at(table, column, row + 1));
        let step = |share: f64, a: f64, b: f64| share * (a + share * (b - a) / 2.0);

        let (left, right) = (
            between_rows(&self.density, column),
            between_rows(&self.density, column + 1),
        );
        let before = between_rows(&self.along_row, column) + step(x, left, right);
        let whole = between_rows(&self.along_row, width - 1);
        let first = blend.iter().map(|&(slice, weight)| {
            let index = slice * height + row;
            weight * self.across_rows.get(index).copied().unwrap_or(f64::NAN)
        });
        let rows = first.sum::<f64>()
            + step(
                y,
                at(&self.along_row, width - 1, row),
                at(&self.along_row, width - 1, row + 1),
            );
        // A row without density has no inside: any point of it will do.
        [
            if whole > 0.0 {
                before / whole
            } else {
                point[0]
            },
            rows,
        ]
    }

    /// Of each slice.
    pub(super) fn size(&self) -> Size {
        self.size
    }

    /// The density of a slice at a point, with integral 1.
    pub(super) fn density(&self, slice: usize, point: [f64; 2]) -> f64 {
        let begin = slice * self.size.area();
        let density = self.density.get(begin..).unwrap_or_default();
        let cells = (self.size.width - 1) * (self.size.height - 1);
        let number = |index: usize| density.get(index).copied().unwrap_or(f64::NAN);
        cells as f64 * self.size.bilinear(point, number)
    }

    /// Which point of the unit square [`flatten`](Self::flatten) takes to this one, under one slice's
    /// density.
    pub(super) fn unflatten(&self, slice: usize, [x, y]: [f64; 2]) -> [f64; 2] {
        let (width, height) = (self.size.width, self.size.height);
        let value = |table: &[f64], row: usize, column: usize| {
            let index = (slice * height + row) * width + column;
            table.get(index).copied().unwrap_or(f64::NAN)
        };
        let begins = (0..height).map(|row| self.across_rows.get(slice * height + row));
        let begins: Vec<f64> = begins
            .map(|begin| begin.copied().unwrap_or(f64::NAN))
            .collect();
        let row = step_of(&begins, y);
        let total = |row| value(&self.along_row, row, width - 1);
        let down = share(y - begins[row], total(row), total(row + 1));

        let between = |table: &[f64], column| {
            mix(
                down,
                value(table, row, column),
                value(table, row + 1, column),
            )
        };
        let along: Vec<f64> = (0..width).map(|c| between(&self.along_row, c)).collect();
        let target = x * along[width - 1];
        let column = step_of(&along, target);
        let (left, right) = (
            between(&self.density, column),
            between(&self.density, column + 1),
        );
        let across = share(target - along[column], left, right);
        let place = |step: usize, share: f64, size: usize| {
            let steps = (size - 1) as f64;
            ((step as f64 + share) / steps).clamp(0.0, 1.0)
        };
        [place(column, across, width), place(row, down, height)]
    }
}

/// The step between two of these numbers, which do not fall, that holds `target`.
fn step_of(numbers: &[f64], target: f64) -> usize {
    let after = numbers.partition_point(|&number| number <= target);
    after.saturating_sub(1).min(numbers.len() - 2)
}

/// The share `s` of a step between `a` and `b` with the integral $s (a + s (b - a) / 2)$.
fn share(integral: f64, a: f64, b: f64) -> f64 {
    let root = (a * a + 2.0 * integral * (b - a)).max(0.0).sqrt();
    if a + root > 0.0 {
        2.0 * integral / (a + root)
    } else {
        0.0
    }
}

/// Appends the integrals of the interpolant of `values` from the first to each; gives the last.
fn cumulate(values: &[f64], to: &mut Vec<f64>) -> f64 {
    let mut sum = 0.0;
    to.push(sum);
    for pair in values.windows(2) {
        sum += f64::midpoint(pair[0], pair[1]);
        to.push(sum);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ONE: Blend = [(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)];

    #[test]
    fn a_uniform_density_is_left_as_it_is() {
        let size = Size {
            width: 5,
            height: 3,
        };
        let warp = Warp::new(size, [7.0; 15].into_iter()).unwrap();
        for point in [[0.0, 0.0], [1.0, 1.0], [0.3, 0.8], [0.99, 0.5]] {
            let [x, y] = warp.flatten(&ONE, point);
            assert!((x - point[0]).abs() < 1e-15 && (y - point[1]).abs() < 1e-15);
        }
    }

    #[test]
    fn the_density_x_plus_y_is_flattened_as_on_paper() {
        // Rows: int (x + y) dx = y + 1/2, so (y^2 + y) / 2. Along a row:
        // (x^2 / 2 + x y) / (y + 1/2). Any table that is exact for x + y must give the same.
        let square = |n| Size {
            width: n,
            height: n,
        };
        for n in [2_u8, 3, 9] {
            let side = || (0..n).map(move |k| f32::from(k) / f32::from(n - 1));
            let table = side().flat_map(|y| side().map(move |x| x + y));
            let warp = Warp::new(square(usize::from(n)), table).unwrap();
            for (x, y) in [(0.0, 0.0), (0.2, 0.9), (0.5, 0.5), (1.0, 0.3), (1.0, 1.0)] {
                let [u, v] = warp.flatten(&ONE, [x, y]);
                let along = (x * x / 2.0 + x * y) / (y + 0.5);
                // Eighths are exact in the table; sums of at most 81 of them in double precision.
                assert!((u - along).abs() < 1e-14, "{n} {x} {y}");
                assert!((v - (y * y + y) / 2.0).abs() < 1e-14, "{n} {x} {y}");
            }
        }
    }

    #[test]
    fn a_density_has_the_integral_1() {
        let size = Size {
            width: 3,
            height: 2,
        };
        let warp = Warp::new(size, [0.0, 1.0, 2.0, 0.0, 3.0, 6.0].into_iter()).unwrap();
        // 4 x (1/2 + y): its integral is 2.
        for [x, y] in [[0.0, 0.0], [0.3, 0.5], [1.0, 1.0]] {
            let found = warp.density(0, [x, y]);
            assert!((found - 2.0 * x * (0.5 + y)).abs() < 1e-14, "{found}");
        }
    }

    #[test]
    fn parameters_are_interpolated_and_held_beyond_their_ends() {
        let axis = Axis(vec![0.0, 1.0, 3.0]);
        assert_eq!(axis.around(2.0), [(1, 0.5), (2, 0.5)]);
        assert_eq!(axis.around(-1.0), [(0, 1.0), (1, 0.0)]);
        assert_eq!(axis.around(9.0), [(1, 0.0), (2, 1.0)]);
        assert_eq!(Axis(vec![0.5]).around(9.0), [(0, 1.0), (0, 0.0)]);
        let blend = Axis::blend(Axis(vec![0.0, 1.0]).around(0.25), &axis, 2.0);
        assert_eq!(blend, [(1, 0.375), (2, 0.375), (4, 0.125), (5, 0.125)]);
    }

    #[test]
    fn a_density_that_is_zero_everywhere_is_refused() {
        let size = Size {
            width: 2,
            height: 2,
        };
        let tables = [1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(Warp::new(size, tables.into_iter()), Err(1));
    }

    proptest! {
        #[test]
        fn the_square_goes_to_itself_in_order(
            table in proptest::collection::vec(0.0_f32..5.0, 12),
            y in 0.0..=1.0, a in 0.0..=1.0, b in 0.0..=1.0,
        ) {
            let size = Size { width: 4, height: 3 };
            let Ok(warp) = Warp::new(size, table.iter().copied()) else { return Ok(()) };
            let (low, high): (f64, f64) = if a < b { (a, b) } else { (b, a) };
            let [u, v] = warp.flatten(&ONE, [low, y]);
            let [w, same] = warp.flatten(&ONE, [high, y]);
            prop_assert_eq!(v, same);
            prop_assert!(u <= w + 1e-15);
            for number in [u, v, w] {
                prop_assert!((-1e-15..=1.0 + 1e-15).contains(&number));
            }
            // Where the density is small both ways lose digits.
            if table.iter().all(|&number| number > 0.1) {
                let there = warp.flatten(&ONE, warp.unflatten(0, [low, y]));
                prop_assert!((there[0] - low).abs() + (there[1] - y).abs() < 1e-9);
            }
            let corner = warp.flatten(&ONE, [1.0, 1.0]);
            prop_assert!((corner[1] - 1.0).abs() < 1e-14);
        }
    }
}
