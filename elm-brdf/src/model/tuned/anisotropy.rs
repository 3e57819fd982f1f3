//! Whether a surface looks different when it is turned about its normal, and in which direction it does.

use std::f64::consts::{FRAC_PI_2, PI};

use elm::solve::{LeastSquares, Ridge, Solver};
use ndarray::{Array1, Array2, ArrayView2, Axis, Slice, concatenate};

use super::errors::no_fit;
use crate::error::Result;
use crate::features::Features;
use crate::target_transform::TargetTransform;
use elm_datasets::geometry::DirectionPair;

/// Rows that are looked at, at most.
const ROWS: usize = 1500;
/// With fewer, the polynomials are shorter.
const FEW: usize = 120;
/// With fewer nothing can be told.
const FEWEST: usize = 40;
const FOLDS: usize = 5;
/// Regularization of the polynomials, relative.
const LAMBDA: f64 = 1e-6;
/// The part of the error at rows left out that must be explained by the direction of the half vector.
const EXPLAINED: f64 = 0.1;

/// The inputs that turn with the surface, turned to its grain, if it has one that these measurements can
/// tell: polynomials in the isotropic inputs predict rows left out better with terms that depend on the
/// azimuth of the half vector.
pub(super) fn detect(
    pairs: &[DirectionPair],
    targets: ArrayView2<'_, f64>,
) -> Result<Option<Features>> {
    if pairs.len() < FEWEST || !azimuths_vary(pairs) {
        return Ok(None);
    }
    let (some, targets) = part(pairs, targets);
    let terms = Terms::of(&some);
    let isotropic = Slice::from(..terms.isotropic);
    let isotropic = terms.all.slice_axis(Axis(1), isotropic).to_owned();
    let without = left_out(&isotropic, &targets)?;
    let with = left_out(&terms.all, &targets)?;
    if with.is_nan() || with > (1.0 - EXPLAINED) * without {
        return Ok(None);
    }
    Ok(Some(terms.direction(&targets)?))
}

/// Some of the pairs, and the mean of their channels' targets.
fn part(
    pairs: &[DirectionPair],
    targets: ArrayView2<'_, f64>,
) -> (Vec<DirectionPair>, Array2<f64>) {
    let step = pairs.len().div_ceil(ROWS);
    let rows: Vec<usize> = (0..pairs.len()).step_by(step).collect();
    let mean = targets.mean_axis(Axis(1)).unwrap_or_default();
    (
        rows.iter().map(|&row| pairs[row]).collect(),
        mean.select(Axis(0), &rows).insert_axis(Axis(1)),
    )
}

/// Whether these measurements (BRDF in 1/sr, shape (pairs, channels)) show a surface that looks different
/// after half a turn about its normal, such as velvet that was stroked or facets that lean to one side. No
/// set of [`Features`] can tell that: a network is fitted as if it looked the same.
///
/// Polynomials in the inputs, those of a grain included, predict rows left out better by a tenth with terms
/// that change sign after half a turn.
///
/// # Errors
/// Those of [`Fit::fit`](crate::fit::Fit::fit) for measurements that cannot be fitted.
pub fn changes_after_half_turn(
    pairs: &[DirectionPair],
    values: ArrayView2<'_, f64>,
) -> Result<bool> {
    crate::fit::check(pairs, values)?;
    if pairs.len() < FEWEST || !azimuths_vary(pairs) {
        return Ok(false);
    }
    let targets = TargetTransform::default_log()
        .fit(values)?
        .to_targets(values)?;
    let (some, targets) = part(pairs, targets.view());
    let terms = Terms::of(&some);
    let without = left_out(&terms.all, &targets)?;
    let with = left_out(&terms.with_sides(&some)?, &targets)?;
    Ok(with <= (1.0 - EXPLAINED) * without)
}

/// Whether the light came from sides different enough to tell how a surface looks that is turned. Half a
/// turn tells nothing.
fn azimuths_vary(pairs: &[DirectionPair]) -> bool {
    // Of lights from one side, and from the opposite one, this mean is 1.
    const ONE_SIDE: f64 = 0.9;
    // So near the normal the azimuth says little.
    const NORMAL: f64 = 0.1;
    let (mut cos, mut sin, mut count) = (0.0, 0.0, 0.0_f64);
    for [x, y, _] in pairs.iter().map(|pair| pair.incident) {
        let across = x * x + y * y;
        if across > NORMAL * NORMAL {
            cos += (x * x - y * y) / across;
            sin += 2.0 * x * y / across;
            count += 1.0;
        }
    }
    count > 0.0 && (cos / count).hypot(sin / count) < ONE_SIDE
}

/// Polynomials at each pair.
struct Terms {
    /// Those in the isotropic inputs first.
    all: Array2<f64>,
    isotropic: usize,
    /// Powers of the root of the half vector's angle, shape (pairs, powers); each has a term with the cosine
    /// and one with the sine of twice its azimuth.
    roots: Array2<f64>,
}

impl Terms {
    fn of(pairs: &[DirectionPair]) -> Self {
        let x = Features::Anisotropic { degrees: 0 }.compute(pairs);
        let inputs = Features::Highlight.inputs().len();
        let scaled = |input: usize| {
            let column = x.column(input);
            let (mean, deviation) = (column.mean().unwrap_or(0.0), column.std(0.0));
            column.mapv(|value| (value - mean) / deviation.max(1e-9))
        };
        let scaled: Vec<Array1<f64>> = (0..inputs).map(scaled).collect();
        let (degree, powers) = if pairs.len() < FEW { (2, 2) } else { (3, 4) };
        // Each product once: factors in order.
        let mut columns = vec![(0, Array1::ones(pairs.len()))];
        let mut last = columns.clone();
        for _ in 0..degree {
            let products = last.iter().flat_map(|(first, product)| {
                let further = scaled.iter().enumerate().skip(*first);
                further.map(move |(input, factor)| (input, product * factor))
            });
            last = products.collect();
            columns.extend(last.iter().cloned());
        }
        let isotropic = columns.len();
        let most = x.column(0).fold(0.0_f64, |most, &root| most.max(root));
        let root = x.column(0).mapv(|root| root / most.max(1e-9));
        for input in [inputs, inputs + 1] {
            let mut term = &x.column(input) / most.max(1e-9);
            for _ in 0..powers {
                columns.push((0, term.clone()));
                term *= &root;
            }
        }
        let roots = Array2::from_shape_fn((pairs.len(), powers), |(row, power)| {
            root[row].powi(power as i32 + 1)
        });
        let mut all = Array2::zeros((pairs.len(), columns.len()));
        for (mut out, (_, column)) in all.columns_mut().into_iter().zip(columns) {
            out.assign(&column);
        }
        Self {
            all,
            isotropic,
            roots,
        }
    }

    /// All, and for each power a term with the cosine and one with the sine of the half vector's azimuth.
    fn with_sides(&self, pairs: &[DirectionPair]) -> Result<Array2<f64>> {
        let powers = self.roots.ncols();
        let sides = Array2::from_shape_fn((pairs.len(), 2 * powers), |(row, term)| {
            let (i, o) = (pairs[row].incident, pairs[row].outgoing);
            let (x, y) = (i[0] + o[0], i[1] + o[1]);
            let part = if term < powers { x } else { y };
            self.roots[[row, term % powers]] * part / x.hypot(y).max(f64::MIN_POSITIVE)
        });
        concatenate(Axis(1), &[self.all.view(), sides.view()]).map_err(|_| no_fit())
    }

    /// The direction along which, or across which, most varies.
    fn direction(&self, targets: &Array2<f64>) -> Result<Features> {
        let weights = solved(&self.all, targets)?;
        let powers = self.roots.ncols();
        let amplitude = |first: usize| {
            let own = Slice::from(first..first + powers);
            self.roots.dot(&weights.column(0).slice_axis(Axis(0), own))
        };
        let (cos, sin) = (
            amplitude(self.isotropic),
            amplitude(self.isotropic + powers),
        );
        let (same, product) = (cos.dot(&cos) - sin.dot(&sin), 2.0 * cos.dot(&sin));
        // Twice the azimuth is the axis of these pairs of amplitudes, and an axis half the angle of its
        // double.
        let azimuth = (product.atan2(same) / 4.0).rem_euclid(FRAC_PI_2);
        let degrees = (azimuth / PI * 180.0).round() as u8 % 90;
        Ok(Features::Anisotropic { degrees })
    }
}

/// The mean error at rows left out, a fifth at a time.
fn left_out(terms: &Array2<f64>, targets: &Array2<f64>) -> Result<f64> {
    let rows = terms.nrows();
    let mut sum = 0.0;
    for fold in 0..FOLDS {
        let (out, known): (Vec<usize>, Vec<usize>) = (0..rows).partition(|row| row % FOLDS == fold);
        let weights = solved(
            &terms.select(Axis(0), &known),
            &targets.select(Axis(0), &known),
        )?;
        let errors = terms.select(Axis(0), &out).dot(&weights) - targets.select(Axis(0), &out);
        sum += errors.mapv(f64::abs).sum();
    }
    Ok(sum / rows as f64)
}

fn solved(terms: &Array2<f64>, targets: &Array2<f64>) -> Result<Array2<f64>> {
    let problem = LeastSquares::new(terms, targets)?;
    Ok(Solver::from(Ridge::relative(LAMBDA)).solve(&problem)?.beta)
}

#[cfg(test)]
mod tests {
    use super::*;
    use elm_datasets::geometry::cartesian;
    use elm_datasets::lobes;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::TAU;

    fn directions(count: usize) -> Vec<DirectionPair> {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut direction =
            || cartesian(random.random_range(0.0..1.3), random.random_range(0.0..TAU));
        (0..count)
            .map(|_| DirectionPair {
                incident: direction(),
                outgoing: direction(),
            })
            .collect()
    }

    #[test]
    fn the_direction_of_a_grain_is_found_and_none_where_there_is_none() {
        for rows in [60, 300, 5000] {
            let pairs = directions(rows);
            for turn in [0.0_f64, 0.4, 1.0, 2.2] {
                let value = |pair: &DirectionPair| {
                    (0.05 + lobes::anisotropic_ggx(pair, 0.8, [0.15, 0.5], turn)).ln()
                };
                let targets = Array2::from_shape_fn((rows, 1), |(row, _)| value(&pairs[row]));
                let found = detect(&pairs, targets.view()).unwrap();
                let Some(Features::Anisotropic { degrees }) = found else {
                    panic!("{rows} rows, {turn}: {found:?}");
                };
                // Along and across are a quarter of a turn apart.
                let off = (f64::from(degrees) - turn.to_degrees()).rem_euclid(90.0);
                assert!(off.min(90.0 - off) < 8.0, "{rows} rows, {turn}: {degrees}");
            }
            let value = |pair: &DirectionPair| (0.05 + lobes::ggx(pair, 0.8, 0.3)).ln();
            let targets = Array2::from_shape_fn((rows, 1), |(row, _)| value(&pairs[row]));
            assert_eq!(detect(&pairs, targets.view()).unwrap(), None, "{rows} rows");
        }
    }

    #[test]
    fn facets_that_lean_to_one_side_are_told_from_a_grain_and_from_neither() {
        // The half vector leans by 0.25 in the direction of 0.7 radians.
        let leaning = |pair: &DirectionPair| {
            let (i, o) = (pair.incident, pair.outgoing);
            let half = [i[0] + o[0], i[1] + o[1], i[2] + o[2]];
            let length = half.iter().map(|part| part * part).sum::<f64>().sqrt();
            let facet = cartesian(0.25, 0.7);
            let cos: f64 = half.iter().zip(facet).map(|(a, b)| a * b).sum::<f64>() / length;
            0.05 + cos.max(0.0).powi(40)
        };
        let brushed =
            |pair: &DirectionPair| 0.05 + lobes::anisotropic_ggx(pair, 0.8, [0.15, 0.5], 0.4);
        let plain = |pair: &DirectionPair| 0.05 + lobes::ggx(pair, 0.8, 0.3);
        for rows in [60, 300, 5000] {
            let pairs = directions(rows);
            let of = |value: &dyn Fn(&DirectionPair) -> f64| {
                let values = Array2::from_shape_fn((rows, 1), |(row, _)| value(&pairs[row]));
                changes_after_half_turn(&pairs, values.view()).unwrap()
            };
            assert!(of(&leaning), "{rows} rows");
            assert!(!of(&brushed), "{rows} rows");
            assert!(!of(&plain), "{rows} rows");
        }
    }
}
