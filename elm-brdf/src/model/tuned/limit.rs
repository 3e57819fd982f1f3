//! The limit of infinitely many neurons, fitted to few measurements in closed form.
//!
//! Sine neurons whose frequencies are drawn from a density, and whose phases are uniform, have as their
//! number grows the inner product of a covariance: the Fourier transform of that density (A. Rahimi,
//! B. Recht, *Random Features for Large-Scale Kernel Machines*, NIPS 2007). Ridge regression on them is a
//! Gaussian process: no draw decides what it says between the measurements, and its restricted likelihood
//! has a gradient, by which the scale of each input and the noise are found (C. Rasmussen, C. Williams,
//! *Gaussian Processes for Machine Learning*, 2006, chapters 2, 4 and 5).

use elm::solve::Cholesky;
use ndarray::{Array1, Array2, Axis};

use super::covariance::{Decay, Smoothness};
use super::errors::no_fit;
use crate::error::Result;
use crate::scales::spread;

/// Bounds of the scales of standardised inputs, and of the noise's variance relative to the network's.
const SCALES: (f64, f64) = (0.02, 30.0);
const NOISES: (f64, f64) = (1e-8, 1e3);
/// Where the search begins: the best of these.
const FIRST_SCALES: (f64, f64) = (0.05, 3.3);
const FIRST_NOISES: [f64; 2] = [1e-5, 1e-2];
const STARTS: usize = 16;
/// A priori the logarithms of the scales are normal about that of this one, with deviation 1.
const USUAL_SCALE: f64 = 0.4;
/// Evidence that is lower by no more than this is as good: that of a parameter two standard errors off.
const AS_GOOD: f64 = 2.0;
/// First and largest step of the logarithms, and the step at which the search ends.
const STEP: f64 = 0.4;
const LARGEST_STEP: f64 = 1.0;
const MIN_STEP: f64 = 0.02;

/// What a fit of the limit is given.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Setting {
    pub(super) smoothness: Smoothness,
    /// Of each standardised input.
    pub(super) scales: Array1<f64>,
    /// Variance relative to that of the network.
    pub(super) noise: f64,
    /// The logarithm of the restricted likelihood of all channels and of the scales' prior density, up to
    /// a constant of the rows.
    pub(super) evidence: f64,
}

/// Rows of a fit.
pub(super) struct Rows {
    /// Standardised inputs.
    pub(super) x: Array2<f64>,
    pub(super) targets: Array2<f64>,
    /// How many times as large as that of the others the variance of each row's noise is.
    pub(super) spread: Array1<f64>,
}

/// How unlikely the scales are a priori.
fn improbability(scales: &Array1<f64>) -> f64 {
    let away = scales.mapv(|scale| (scale / USUAL_SCALE).ln());
    0.5 * away.dot(&away)
}

/// The inverse of the covariance, and what is left of it where a constant is fitted too.
struct Inverse {
    /// $P = \Sigma^{-1} - \Sigma^{-1} 1 1^T \Sigma^{-1} / (1^T \Sigma^{-1} 1)$.
    p: Array2<f64>,
    /// $\ln |\Sigma| + \ln (1^T \Sigma^{-1} 1)$.
    complexity: f64,
}

impl Inverse {
    /// `None` where rounding has made the covariance indefinite.
    fn of(mut covariance: Array2<f64>, noise: f64, spread: &Array1<f64>) -> Result<Option<Self>> {
        covariance.diag_mut().scaled_add(noise, spread);
        // By columns, which it is as well as by rows, for it is symmetric.
        let Ok(factor) = Cholesky::new(covariance.reversed_axes()) else {
            return Ok(None);
        };
        let mut p = factor.inverse()?;
        let sums = p.sum_axis(Axis(0));
        let total = sums.sum();
        if !(total > 0.0 && total.is_finite()) {
            return Ok(None);
        }
        for (mut row, sum) in p.rows_mut().into_iter().zip(&sums) {
            row.scaled_add(-sum / total, &sums);
        }
        let complexity = factor.log_determinant() + total.ln();
        Ok(Some(Self { p, complexity }))
    }
}

impl Rows {
    /// Some of the rows.
    pub(super) fn select(&self, rows: &[usize]) -> Self {
        Self {
            x: self.x.select(Axis(0), rows),
            targets: self.targets.select(Axis(0), rows),
            spread: self.spread.select(Axis(0), rows),
        }
    }

    /// The evidence where, for each channel, $y^T P y$ is what of it is left.
    fn evidence_of(
        &self,
        scales: &Array1<f64>,
        complexity: f64,
        left: impl Iterator<Item = f64>,
    ) -> f64 {
        let rows = self.x.nrows().saturating_sub(1).max(1) as f64;
        let fit: f64 = left
            .map(|left| rows * (left.max(f64::MIN_POSITIVE) / rows).ln() + complexity)
            .sum();
        -0.5 * fit - improbability(scales)
    }

    /// The correlations of the rows.
    fn correlations(&self, smoothness: Smoothness, scales: &Array1<f64>) -> Array2<f64> {
        let z = &self.x * scales;
        Decay::between(smoothness, &z, &z).correlations()
    }

    /// The evidence of scales, of which the rows have these correlations, and of a noise.
    fn evidence(
        &self,
        scales: &Array1<f64>,
        correlations: &Array2<f64>,
        noise: f64,
    ) -> Result<Option<f64>> {
        let mut covariance = correlations.t().to_owned();
        covariance.diag_mut().scaled_add(noise, &self.spread);
        let Ok(factor) = Cholesky::new(covariance) else {
            return Ok(None);
        };
        let ones = Array2::ones((self.x.nrows(), 1));
        let solved_ones = factor.solve(&ones)?.remove_axis(Axis(1));
        let solved = factor.solve(&self.targets)?;
        let total = solved_ones.sum();
        let complexity = factor.log_determinant() + total.ln();
        let columns = solved.columns().into_iter().zip(self.targets.columns());
        let left = columns.map(|(solved, t)| solved.dot(&t) - solved_ones.dot(&t).powi(2) / total);
        let evidence = self.evidence_of(scales, complexity, left);
        Ok(evidence.is_finite().then_some(evidence))
    }

    /// The evidence of a setting, and its slopes along the logarithms of the scales and of the noise.
    fn slopes(
        &self,
        smoothness: Smoothness,
        scales: &Array1<f64>,
        noise: f64,
    ) -> Result<Option<(f64, Array1<f64>)>> {
        let z = &self.x * scales;
        let decay = Decay::between(smoothness, &z, &z);
        let Some(inverse) = Inverse::of(decay.correlations(), noise, &self.spread)? else {
            return Ok(None);
        };
        let (n, channels) = self.targets.dim();
        let rows = n.saturating_sub(1).max(1) as f64;
        let alpha = inverse.p.dot(&self.targets);
        let columns = alpha.columns().into_iter().zip(self.targets.columns());
        let left: Vec<f64> = columns.map(|(alpha, t)| alpha.dot(&t)).collect();
        let evidence = self.evidence_of(scales, inverse.complexity, left.iter().copied());
        // W with evidence' = sum of W * covariance'.
        let mut w = inverse.p;
        w *= -0.5 * channels as f64;
        for (alpha, left) in alpha.columns().into_iter().zip(left) {
            let factor = 0.5 * rows / left.max(f64::MIN_POSITIVE);
            for (mut row, a) in w.rows_mut().into_iter().zip(&alpha) {
                row.scaled_add(factor * a, &alpha);
            }
        }
        let mut slopes = Array1::zeros(scales.len() + 1);
        slopes[scales.len()] = noise * w.diag().dot(&self.spread);
        // The squared distance along one input is u^2 + v^2 - 2 u v.
        decay.scale_by_slopes(&mut w);
        let sums = w.sum_axis(Axis(1));
        let products = w.dot(&z);
        for (input, slope) in slopes.iter_mut().take(scales.len()).enumerate() {
            let z = z.column(input);
            let own: f64 = z.iter().zip(&sums).map(|(z, sum)| z * z * sum).sum();
            *slope = 2.0 * (own - z.dot(&products.column(input)));
            *slope -= (scales[input] / USUAL_SCALE).ln();
        }
        Ok(evidence.is_finite().then_some((evidence, slopes)))
    }

    /// The best of some settings all over the range.
    pub(super) fn start(&self, smoothness: Smoothness) -> Result<Setting> {
        let inputs = self.x.ncols();
        let mut best = Setting {
            smoothness,
            scales: Array1::from_elem(inputs, USUAL_SCALE),
            noise: FIRST_NOISES[1],
            evidence: f64::NEG_INFINITY,
        };
        for scales in spread(STARTS, inputs, FIRST_SCALES).rows() {
            let scales = scales.to_owned();
            let correlations = self.correlations(smoothness, &scales);
            for noise in FIRST_NOISES {
                let found = self.evidence(&scales, &correlations, noise)?;
                if let Some(evidence) = found.filter(|&evidence| evidence > best.evidence) {
                    best = Setting {
                        smoothness,
                        scales: scales.clone(),
                        noise,
                        evidence,
                    };
                }
            }
        }
        Ok(best)
    }

    /// Follows the slopes from a setting, each logarithm by a step of its own that grows while the sign
    /// stays and shrinks where it turns (C. Igel, M. Hüsken, *Improving the Rprop Learning Algorithm*,
    /// NC 2000).
    pub(super) fn improved(&self, from: &Setting, rounds: usize) -> Result<Setting> {
        let inputs = from.scales.len();
        let bounds = |k: usize| if k < inputs { SCALES } else { NOISES };
        let mut at = from.scales.mapv(f64::ln).to_vec();
        at.push(from.noise.ln());
        let mut steps = vec![STEP; inputs + 1];
        let mut before = vec![0.0; inputs + 1];
        let mut best = Setting {
            evidence: f64::NEG_INFINITY,
            ..from.clone()
        };
        for _ in 0..rounds {
            let scales = Array1::from_iter(at[..inputs].iter().map(|at| at.exp()));
            let noise = at[inputs].exp();
            let Some((evidence, slopes)) = self.slopes(from.smoothness, &scales, noise)? else {
                break;
            };
            if evidence > best.evidence {
                best = Setting {
                    scales,
                    noise,
                    evidence,
                    ..best
                };
            }
            for k in 0..=inputs {
                let mut slope = slopes[k];
                let turn: f64 = slope * before[k];
                if turn > 0.0 {
                    steps[k] = (steps[k] * 1.2).min(LARGEST_STEP);
                } else if turn < 0.0 {
                    steps[k] *= 0.5;
                    slope = 0.0;
                }
                before[k] = slope;
                if slope != 0.0 {
                    let (low, high) = bounds(k);
                    at[k] = (at[k] + slope.signum() * steps[k]).clamp(low.ln(), high.ln());
                }
            }
            if steps.iter().all(|&step| step < MIN_STEP) {
                break;
            }
        }
        Ok(best)
    }
}

impl Rows {
    /// The setting with the largest noise whose evidence is as good: where noise is as large as values
    /// are, the difference between a slope and none is often luck.
    pub(super) fn calmest(&self, setting: &Setting) -> Result<Setting> {
        let correlations = self.correlations(setting.smoothness, &setting.scales);
        let of = |noise: f64| self.evidence(&setting.scales, &correlations, noise);
        let mut calmest = setting.clone();
        let mut most = of(setting.noise)?.unwrap_or(f64::NEG_INFINITY);
        let mut noise = setting.noise;
        while noise < NOISES.1 {
            noise = (10.0 * noise).min(NOISES.1);
            let evidence = of(noise)?.unwrap_or(f64::NEG_INFINITY);
            if evidence + AS_GOOD >= most {
                calmest.noise = noise;
            }
            most = most.max(evidence);
        }
        Ok(calmest)
    }
}

/// Weights of the rows, and a constant.
type Weights = (Array2<f64>, Array1<f64>);

/// A fit to all rows, and to all but those of each fold.
pub(super) struct Limit {
    smoothness: Smoothness,
    z: Array2<f64>,
    scales: Array1<f64>,
    noise: Array1<f64>,
    correlations: Array2<f64>,
    p: Array2<f64>,
    all: Weights,
    without: Vec<Weights>,
}

impl Limit {
    /// Folds are of places among the rows.
    pub(super) fn new(rows: &Rows, setting: &Setting, folds: &[Vec<usize>]) -> Result<Self> {
        let smoothness = setting.smoothness;
        let z = &rows.x * &setting.scales;
        let correlations = Decay::between(smoothness, &z, &z).correlations();
        let inverse = Inverse::of(correlations.clone(), setting.noise, &rows.spread)?;
        let mut limit = Self {
            smoothness,
            z,
            scales: setting.scales.clone(),
            noise: &rows.spread * setting.noise,
            correlations,
            p: inverse.ok_or_else(no_fit)?.p,
            all: (Array2::zeros((0, 0)), Array1::zeros(0)),
            without: Vec::new(),
        };
        limit.fit(&rows.targets);
        let count = rows.x.nrows();
        for fold in folds {
            if fold.len() == count {
                limit.without.push(limit.all.clone());
                continue;
            }
            // Of P without some rows the product with the targets, by the formula of the block inverse.
            let block = limit.p.select(Axis(0), fold).select(Axis(1), fold);
            let factor = Cholesky::new(block).map_err(|_| no_fit())?;
            let errors = factor.solve(&limit.all.0.select(Axis(0), fold))?;
            let mut alpha = &limit.all.0 - &limit.p.select(Axis(1), fold).dot(&errors);
            let mut there = vec![true; count];
            for &row in fold {
                alpha.row_mut(row).fill(0.0);
                there[row] = false;
            }
            let constant = limit.constant(&alpha, &rows.targets, &there);
            limit.without.push((alpha, constant));
        }
        Ok(limit)
    }

    /// Fits all rows to other targets.
    pub(super) fn fit(&mut self, targets: &Array2<f64>) {
        let alpha = self.p.dot(targets);
        let constant = self.constant(&alpha, targets, &vec![true; targets.nrows()]);
        self.all = (alpha, constant);
    }

    /// What is left of the targets of the rows that are there, the same in all of them to rounding.
    fn constant(&self, alpha: &Array2<f64>, targets: &Array2<f64>, there: &[bool]) -> Array1<f64> {
        let noise = self.noise.view().insert_axis(Axis(1));
        let left = targets - &self.correlations.dot(alpha) - &(alpha * &noise);
        let mut sum = Array1::zeros(targets.ncols());
        let mut count: f64 = 0.0;
        for (row, _) in left
            .rows()
            .into_iter()
            .zip(there)
            .filter(|(_, there)| **there)
        {
            sum += &row;
            count += 1.0;
        }
        sum / count.max(1.0)
    }

    /// Predictions at the rows.
    pub(super) fn fitted(&self) -> Array2<f64> {
        self.correlations.dot(&self.all.0) + &self.all.1
    }

    /// Predictions at standardised inputs, with all rows and without each fold.
    pub(super) fn predict(&self, x: &Array2<f64>) -> (Array2<f64>, Vec<Array2<f64>>) {
        let k = Decay::between(self.smoothness, &(x * &self.scales), &self.z).correlations();
        let of = |(alpha, constant): &Weights| k.dot(alpha) + constant;
        (of(&self.all), self.without.iter().map(of).collect())
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use ndarray::array;

    use super::*;

    fn rows() -> Rows {
        let x = Array2::from_shape_fn((9, 2), |(i, j)| ((i * 7 + j * 5) % 9) as f64 / 4.0 - 1.0);
        let targets = Array2::from_shape_fn((9, 2), |(i, j)| {
            (x[[i, 0]] + j as f64).sin() + 0.3 * x[[i, 1]] * x[[i, 0]]
        });
        let spread = Array1::from_shape_fn(9, |i| 1.0 + 0.5 * (i % 3) as f64);
        Rows { x, targets, spread }
    }

    #[test]
    fn slopes_are_those_of_the_evidence() {
        let rows = rows();
        let (scales, noise, step) = (array![0.7, 0.4], 1e-2, 1e-5);
        for smoothness in Smoothness::ALL {
            let at = |moved: usize, by: f64| {
                let factor = |k: usize| if k == moved { by.exp() } else { 1.0 };
                let scales = array![scales[0] * factor(0), scales[1] * factor(1)];
                let correlations = rows.correlations(smoothness, &scales);
                let found = rows.evidence(&scales, &correlations, noise * factor(2));
                found.unwrap().unwrap()
            };
            let (evidence, slopes) = rows.slopes(smoothness, &scales, noise).unwrap().unwrap();
            assert_relative_eq!(evidence, at(3, 0.0), max_relative = 1e-12);
            for (k, &slope) in slopes.iter().enumerate() {
                let difference = (at(k, step) - at(k, -step)) / (2.0 * step);
                // Of second order in the step; the evidence is some ten, rounded to 1e-15 of that.
                assert_relative_eq!(slope, difference, epsilon = 1e-7, max_relative = 1e-7);
            }
        }
    }

    #[test]
    fn without_a_fold_is_the_fit_of_the_others() {
        let rows = rows();
        let setting = Setting {
            smoothness: Smoothness::Twice,
            scales: array![0.7, 0.4],
            noise: 1e-2,
            evidence: 0.0,
        };
        let fold = vec![1, 4, 7];
        let all = Limit::new(&rows, &setting, std::slice::from_ref(&fold)).unwrap();
        let others: Vec<usize> = (0..9).filter(|row| !fold.contains(row)).collect();
        let fewer = Limit::new(&rows.select(&others), &setting, &[]).unwrap();
        let at = rows.x.select(Axis(0), &fold);
        let (_, without) = all.predict(&at);
        let (expected, _) = fewer.predict(&at);
        assert_relative_eq!(without[0], expected, epsilon = 1e-11);
    }
}
