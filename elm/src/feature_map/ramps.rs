//! The embedding of inputs: beside each input its ramps, which rise one after the other along it.

use ndarray::{Array2, ArrayRef1, ArrayRef2, ArrayView1, ArrayView2, s};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::check::{check_length, check_matrix, check_some_weight};
use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// What the neurons see of the inputs.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(
        bound = "",
        rename_all = "kebab-case",
        rename_all_fields = "kebab-case"
    )
)]
#[non_exhaustive]
pub enum Embedding<A: Scalar> {
    /// The inputs alone.
    #[default]
    Inputs,
    /// The inputs and at most this many [`Ramps`] of each, between quantiles of the training rows.
    Quantiles(usize),
    /// The inputs and these ramps, whatever the training rows are.
    Ramps(Ramps<A>),
}

/// Ramps along each input: between two neighbouring edges one rises from 0 to 1, as a straight line, and
/// is level on either side. Ends of the first and the last are the ends of the training rows, beyond
/// which only the input itself goes on.
///
/// A weighted sum of an input and its ramps is any function of that input that is straight between
/// edges (a piecewise linear encoding: Gorishniy, Rubachev and Babenko, On embeddings for numerical
/// features in tabular deep learning, 2022). What a random layer sees of a skewed input, or of one whose
/// effect has a kink, is then at the scale of the rows, not of the units; and a
/// [scale for each ramp](crate::ElmParams::with_input_scales) bends the axis where the targets ask for it.
///
/// ```
/// use elm::Ramps;
/// use ndarray::array;
///
/// let x = array![[0.0, 0.0], [1.0, 0.0], [2.0, 1.0], [9.0, 1.0], [100.0, 1.0]];
/// let ramps = Ramps::quantiles(&x, 2)?;
/// assert_eq!(ramps.edges(0), [0.0, 2.0, 100.0]);
/// // Two values are a column as it is.
/// assert!(ramps.edges(1).is_empty());
/// assert_eq!(ramps.columns(), 2);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", try_from = "Parts<A>"))]
pub struct Ramps<A: Scalar> {
    /// Of each input, rising; none for an input without ramps, else at least two.
    edges: Vec<Vec<A>>,
}

/// [`Ramps`] from outside, before they are known to make sense.
#[cfg(feature = "serde")]
#[derive(Deserialize)]
#[serde(bound = "")]
struct Parts<A: Scalar> {
    edges: Vec<Vec<A>>,
}

#[cfg(feature = "serde")]
impl<A: Scalar> TryFrom<Parts<A>> for Ramps<A> {
    type Error = Error;

    fn try_from(parts: Parts<A>) -> Result<Self> {
        Self::new(parts.edges)
    }
}

impl<A: Scalar> Ramps<A> {
    /// Of the given edges of each input, in its units; empty for an input without ramps.
    ///
    /// # Errors
    /// [`Error::Empty`] without inputs, [`Error::NotFinite`], and [`Error::Parameter`] for edges of
    /// which one is not above the one before it, or for a single one.
    pub fn new(edges: Vec<Vec<A>>) -> Result<Self> {
        if edges.is_empty() {
            return Err(Error::Empty {
                what: "inputs of the ramps",
                rows: 0,
                columns: 0,
            });
        }
        for (input, own) in edges.iter().enumerate() {
            if let Some(row) = own.iter().position(|edge| !edge.is_finite()) {
                return Err(Error::NotFinite {
                    what: "edges of ramps",
                    row,
                    column: input,
                });
            }
            let falls = own.windows(2).find(|pair| pair[0] >= pair[1]);
            if let Some(bad) = falls.map(|pair| pair[1]).or_else(|| lone(own)) {
                return Err(Error::Parameter {
                    name: "edge of a ramp",
                    value: bad.as_f64(),
                    expected: "above the one before it, and at least two of an input",
                });
            }
        }
        Ok(Self { edges })
    }

    /// Between the quantiles of the columns of `x`, shape (rows, inputs), that divide the rows into
    /// `bins` parts of equal size. Quantiles that are equal are one edge; an input with two of them or
    /// fewer, as a constant or a column of 0 and 1, has no ramps.
    ///
    /// # Errors
    /// [`Error::Empty`] and [`Error::NotFinite`] for `x`; [`Error::Parameter`] for 0 bins.
    pub fn quantiles(x: &ArrayRef2<A>, bins: usize) -> Result<Self> {
        check_matrix("inputs", x.view())?;
        check_bins(bins)?;
        Ok(Self::of(x.view(), None, bins))
    }

    /// As [`quantiles`](Self::quantiles), each row counting by its weight.
    ///
    /// # Errors
    /// Those of [`quantiles`](Self::quantiles); [`Error::Shape`] when there is not one weight per row,
    /// [`Error::Parameter`] when one is negative or not finite or when all are 0.
    pub fn quantiles_weighted(
        x: &ArrayRef2<A>,
        weights: &ArrayRef1<A>,
        bins: usize,
    ) -> Result<Self> {
        check_matrix("inputs", x.view())?;
        check_some_weight(weights.view(), x.nrows())?;
        check_bins(bins)?;
        Ok(Self::of(x.view(), Some(weights.view()), bins))
    }

    /// Of checked rows and weights that are in range.
    pub(crate) fn of(
        x: ArrayView2<'_, A>,
        weights: Option<ArrayView1<'_, A>>,
        bins: usize,
    ) -> Self {
        let edges = x.columns().into_iter();
        Self {
            edges: edges
                .map(|column| edges_of(column, weights, bins))
                .collect(),
        }
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.edges.len()
    }

    /// Number of ramps, of all inputs.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.edges.iter().map(|own| ramps(own)).sum()
    }

    /// The edges of an input, rising; none where it has no ramps (or there is no such input).
    #[must_use]
    pub fn edges(&self, input: usize) -> &[A] {
        self.edges.get(input).map_or(&[], Vec::as_slice)
    }

    /// Of each column of the embedding, the inputs first, the input that it is made of.
    pub(crate) fn sources(&self) -> impl Iterator<Item = usize> + '_ {
        let of_ramps = |(input, own): (usize, &Vec<A>)| std::iter::repeat_n(input, ramps(own));
        (0..self.inputs()).chain(self.edges.iter().enumerate().flat_map(of_ramps))
    }

    /// Writes the ramps of rows `x`, as columns of values: an iterator over the inputs' columns, each a
    /// slice, to that of the ramps'.
    pub(super) fn write<'a>(
        &self,
        inputs: impl Iterator<Item = &'a [A]>,
        mut ramps: impl Iterator<Item = &'a mut [A]>,
    ) where
        A: 'a,
    {
        for (own, x) in self.edges.iter().zip(inputs) {
            for (pair, to) in own.windows(2).zip(ramps.by_ref()) {
                let (lower, upper) = (pair[0], pair[1]);
                for (to, &x) in to.iter_mut().zip(x) {
                    *to = height(x, lower, upper);
                }
            }
        }
    }

    /// The embedding: `scaled` inputs, and the ramps of `x`, the same before they were standardized.
    pub(crate) fn beside(&self, scaled: ArrayView2<'_, A>, x: ArrayView2<'_, A>) -> Array2<A> {
        let mut all = Array2::zeros((x.nrows(), self.inputs() + self.columns()));
        all.slice_mut(s![.., ..self.inputs()]).assign(&scaled);
        for (mut to, x) in all.rows_mut().into_iter().zip(x.rows()) {
            let mut to = to.iter_mut().skip(self.inputs());
            for (own, &x) in self.edges.iter().zip(x) {
                for (pair, to) in own.windows(2).zip(to.by_ref()) {
                    *to = height(x, pair[0], pair[1]);
                }
            }
        }
        all
    }

    /// From slopes along the columns of the embedding, shape (rows, columns), those along the inputs,
    /// which are multiplied by `factor` before they are embedded: each ramp rises where a row lies on it.
    pub(super) fn slopes_along_inputs(
        &self,
        slopes: ArrayView2<'_, A>,
        x: ArrayView2<'_, A>,
        factor: impl Fn(usize) -> A,
    ) -> Array2<A> {
        let mut along = slopes.slice(s![.., ..self.inputs()]).to_owned();
        let rows = along.rows_mut().into_iter().zip(slopes.rows());
        for ((mut along, slopes), x) in rows.zip(x.rows()) {
            let mut slopes = slopes.iter().skip(self.inputs());
            for (input, own) in self.edges.iter().enumerate() {
                let (x, factor) = (x[input], factor(input));
                for (pair, &slope) in own.windows(2).zip(slopes.by_ref()) {
                    if pair[0] <= x && x < pair[1] && factor > A::zero() {
                        along[input] += slope / ((pair[1] - pair[0]) * factor);
                    }
                }
            }
        }
        along
    }

    /// Whether these are ramps of this many inputs.
    pub(super) fn check(&self, inputs: usize) -> Result<()> {
        check_length("inputs of the ramps", self.inputs(), inputs)
    }
}

pub(super) fn check_bins(bins: usize) -> Result<()> {
    if bins > 0 {
        return Ok(());
    }
    Err(Error::Parameter {
        name: "ramps",
        value: 0.0,
        expected: "at least 1 of each input",
    })
}

fn ramps<A>(edges: &[A]) -> usize {
    edges.len().saturating_sub(1)
}

fn lone<A: Copy>(edges: &[A]) -> Option<A> {
    match edges {
        [edge] => Some(*edge),
        _ => None,
    }
}

/// How far up a ramp a value lies, from 0 to 1.
#[inline]
pub(super) fn height<A: Scalar>(x: A, lower: A, upper: A) -> A {
    let half = A::from_f64(0.5);
    // In halves, as the difference of two ends of the type's range is out of it.
    let held = x.max(lower).min(upper) * half;
    (held - lower * half) / (upper * half - lower * half)
}

/// The distinct quantiles of a column; none where there are no more than two.
fn edges_of<A: Scalar>(
    column: ArrayView1<'_, A>,
    weights: Option<ArrayView1<'_, A>>,
    bins: usize,
) -> Vec<A> {
    let mut values: Vec<(A, f64)> = match weights {
        None => column.iter().map(|&x| (x, 1.0)).collect(),
        Some(weights) => {
            let largest = weights.iter().fold(0.0, |m: f64, w| m.max(w.as_f64()));
            let counted = column.iter().zip(weights).filter(|(_, w)| **w > A::zero());
            counted.map(|(&x, w)| (x, w.as_f64() / largest)).collect()
        }
    };
    values.sort_by(|a, b| a.0.as_f64().total_cmp(&b.0.as_f64()));
    let total: f64 = values.iter().map(|(_, weight)| weight).sum();
    let mut edges: Vec<A> = Vec::with_capacity(bins + 1);
    let mut rows = values.iter();
    let mut sum = 0.0;
    let Some(mut here) = values.first().map(|(x, _)| *x) else {
        return edges;
    };
    for bin in 0..=bins {
        // The smallest value that this share of the rows does not exceed; sums of weights round.
        let share = total * (bin as f64 / bins as f64) * (1.0 - 1e-12);
        while sum < share
            && let Some((x, weight)) = rows.next()
        {
            sum += weight;
            here = *x;
        }
        if edges.last().is_none_or(|last| *last < here) {
            edges.push(here);
        }
    }
    if let (Some((greatest, _)), Some(last)) = (values.last(), edges.last_mut())
        && *last < *greatest
    {
        *last = *greatest;
    }
    if edges.len() > 2 { edges } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array1, array};

    #[test]
    fn ramps_of_an_input_sum_to_its_place_between_edges() {
        let ramps = Ramps::new(vec![vec![0.0, 1.0, 3.0], vec![]]).unwrap();
        let x = array![[-5.0, 7.0], [0.5, 7.0], [2.0, 7.0], [8.0, 7.0]];
        let embedded = ramps.beside(x.view(), x.view());
        assert_eq!(
            embedded,
            array![
                [-5.0, 7.0, 0.0, 0.0],
                [0.5, 7.0, 0.5, 0.0],
                [2.0, 7.0, 1.0, 0.5],
                [8.0, 7.0, 1.0, 1.0]
            ]
        );
        assert_eq!(ramps.sources().collect::<Vec<_>>(), [0, 1, 0, 0]);
    }

    #[test]
    fn a_weight_is_a_number_of_rows() {
        let x = Array1::from_iter((0..40).map(|i| f64::from(i * i % 41)));
        let counts: Vec<usize> = (0..40).map(|i| [0, 1, 3, 2][i % 4]).collect();
        let repeated = |factor: usize| {
            let all = x.iter().zip(&counts);
            let all = all.flat_map(|(&x, &count)| std::iter::repeat_n(x, factor * count));
            Array1::from_iter(all).insert_axis(ndarray::Axis(1))
        };
        let column = x.clone().insert_axis(ndarray::Axis(1));
        for bins in [1, 2, 7, 16, 100] {
            let expected = Ramps::quantiles(&repeated(1), bins).unwrap();
            for factor in [1.0, 0.3, 1e9] {
                let weights = counts
                    .iter()
                    .map(|&c| factor * c as f64)
                    .collect::<Array1<_>>();
                let weighted = Ramps::quantiles_weighted(&column, &weights, bins).unwrap();
                assert_eq!(weighted, expected, "{bins}");
            }
            assert_eq!(Ramps::quantiles(&repeated(3), bins).unwrap(), expected);
        }
    }

    #[test]
    fn edges_reach_from_the_least_to_the_greatest() {
        let x = Array2::from_shape_fn((101, 3), |(i, j)| [i as f64, 5.0, (i % 2) as f64][j]);
        let ramps = Ramps::quantiles(&x, 16).unwrap();
        assert_eq!((ramps.edges(0)[0], ramps.edges(0)[16]), (0.0, 100.0));
        assert_eq!((ramps.edges(1).len(), ramps.edges(2).len()), (0, 0));
        assert_eq!(ramps.columns(), 16);
    }

    #[test]
    fn edges_that_make_no_ramps_are_refused() {
        assert!(Ramps::<f64>::new(vec![]).is_err());
        for edges in [
            vec![1.0],
            vec![1.0, 1.0],
            vec![2.0, 1.0],
            vec![0.0, f64::NAN],
        ] {
            assert!(Ramps::new(vec![vec![], edges]).is_err());
        }
        assert!(Ramps::quantiles(&array![[1.0]], 0).is_err());
    }

    #[test]
    fn ends_of_the_range_are_no_trouble() {
        let ramps = Ramps::new(vec![vec![-f64::MAX, 0.0, f64::MAX]]).unwrap();
        let x = array![[f64::MAX], [-f64::MAX], [0.5 * f64::MAX]];
        let embedded = ramps.beside(x.view(), x.view());
        assert_eq!(embedded.column(1), array![1.0, 0.0, 1.0]);
        assert_eq!(embedded.column(2), array![1.0, 0.0, 0.5]);
    }
}
