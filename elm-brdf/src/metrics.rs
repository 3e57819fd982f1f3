//! Measures of error of a reflectance model's predictions; every table and file takes them from
//! here.

use std::str::FromStr;
use std::{fmt, iter};

use elm::metrics;
use ndarray::{Array1, ArrayView2, aview1};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::statistics::{deviation, mean};
use elm_datasets::geometry::DirectionPair;

/// The measure that a fit makes small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Metric {
    /// [`Metrics::rmse`].
    #[default]
    Rmse,
    /// [`Metrics::log_cosine_mae`].
    LogCosine,
    /// [`Metrics::cube_root_rmse`].
    CubeRoot,
}

impl Metric {
    /// Every measure there is.
    pub const ALL: [Self; 3] = [Self::Rmse, Self::LogCosine, Self::CubeRoot];

    /// The measure's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rmse => "rmse",
            Self::LogCosine => "log-cosine",
            Self::CubeRoot => "cube-root",
        }
    }

    /// Its value among others.
    #[must_use]
    pub fn of(self, metrics: &Metrics) -> f64 {
        match self {
            Self::Rmse => metrics.rmse,
            Self::LogCosine => metrics.log_cosine_mae,
            Self::CubeRoot => metrics.cube_root_rmse,
        }
    }
}

impl fmt::Display for Metric {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Metric {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Error::find("metric", name, Self::ALL, Self::name)
    }
}

/// Measures of error of a set of predictions $f$ against the truth $g$, over all rows and channels
/// together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// Root mean squared error in 1/sr.
    pub rmse: f64,
    /// Mean absolute error in 1/sr.
    pub mae: f64,
    /// Pearson's correlation coefficient; `None` where it does not exist.
    pub correlation: Option<f64>,
    /// Root mean squared error over the root mean square of the truth: 0 is perfect, 1 is what
    /// black reaches. `None` where all of the truth is 0.
    pub relative_rmse: Option<f64>,
    /// Mean of $|\ln(1 + f \cos\theta_o) - \ln(1 + g \cos\theta_o)|$, the measure of NBRDF
    /// (A. Sztrajman, G. Rainer, T. Ritschel, T. Weyrich, *Neural BRDF Representation and
    /// Importance Sampling*, Computer Graphics Forum 40(6), 2021): highlights do not drown the
    /// rest.
    pub log_cosine_mae: f64,
    /// Root mean squared error of the cube roots, in sr to the power -1/3: dark parts count about
    /// as the eye sees them.
    pub cube_root_rmse: f64,
}

impl Metrics {
    /// The measures of no predictions at all: no error, and nothing that would need one.
    #[cfg(feature = "report")]
    pub(crate) const NONE: Self = Self {
        rmse: 0.0,
        mae: 0.0,
        correlation: None,
        relative_rmse: None,
        log_cosine_mae: 0.0,
        cube_root_rmse: 0.0,
    };

    /// The errors of `predicted` against `truth`, both BRDF in 1/sr without the cosine, of shape
    /// (pairs, channels), at these pairs of directions.
    ///
    /// A viewer below the horizon has the cosine 0. A value so negative that the logarithm does
    /// not exist is taken for the most negative one that has one.
    ///
    /// # Errors
    /// [`elm::Error`] where shapes differ or there is nothing to compare.
    ///
    /// ```
    /// use elm_brdf::metrics::Metrics;
    /// use elm_datasets::geometry::{DirectionPair, cartesian};
    /// use ndarray::array;
    ///
    /// let pair = DirectionPair { incident: cartesian(0.3, 0.0), outgoing: cartesian(0.0, 0.0) };
    /// let metrics = Metrics::of(&[pair], array![[0.5, 1.0]].view(), array![[0.5, 2.0]].view())?;
    /// assert_eq!(metrics.mae, 0.5);
    /// // The first channel agrees; ln 3 - ln 2 in the second.
    /// assert!((metrics.log_cosine_mae - 1.5_f64.ln() / 2.0).abs() < 1e-15);
    /// # Ok::<(), elm_brdf::Error>(())
    /// ```
    pub fn of(
        pairs: &[DirectionPair],
        predicted: ArrayView2<'_, f64>,
        truth: ArrayView2<'_, f64>,
    ) -> Result<Self> {
        let shape = |what, expected, found| Error::Shape {
            what,
            expected,
            found,
        };
        if predicted.ncols() != truth.ncols() {
            return Err(shape("channels", truth.ncols(), predicted.ncols()));
        }
        if predicted.nrows() != truth.nrows() {
            return Err(shape("predictions", truth.nrows(), predicted.nrows()));
        }
        if pairs.len() != truth.nrows() {
            return Err(shape("directions", truth.nrows(), pairs.len()));
        }
        let truth = Truth::new(pairs, truth);
        truth.compare(predicted.iter().copied()).metrics()
    }

    /// The mean of each measure over those that have it; `None` of none.
    #[must_use]
    pub fn mean(all: &[Self]) -> Option<Self> {
        Self::each(all, |values| mean(values.iter().copied()))
    }

    /// The standard deviation of each measure over those that have it, with one less than their
    /// number for a divisor; `None` of fewer than two.
    #[must_use]
    pub fn deviation(all: &[Self]) -> Option<Self> {
        Self::each(all, deviation)
    }

    /// `summary` of the values of each measure.
    fn each(all: &[Self], summary: impl Fn(&[f64]) -> Option<f64>) -> Option<Self> {
        let of = |value: fn(&Self) -> Option<f64>| {
            summary(&all.iter().filter_map(value).collect::<Vec<f64>>())
        };
        Some(Self {
            rmse: of(|m| Some(m.rmse))?,
            mae: of(|m| Some(m.mae))?,
            correlation: of(|m| m.correlation),
            relative_rmse: of(|m| m.relative_rmse),
            log_cosine_mae: of(|m| Some(m.log_cosine_mae))?,
            cube_root_rmse: of(|m| Some(m.cube_root_rmse))?,
        })
    }
}

/// The truth, with what every comparison needs of it.
#[derive(Debug, Clone)]
pub(crate) struct Truth {
    cosines: Vec<f64>,
    values: Vec<f64>,
    cube_roots: Vec<f64>,
}

impl Truth {
    /// Of values of shape (pairs, channels), which are taken row by row.
    pub(crate) fn new(pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Self {
        let cosines = pairs.iter().map(|pair| pair.outgoing[2].max(0.0));
        Self {
            cosines: cosines
                .flat_map(|cosine| iter::repeat_n(cosine, values.ncols()))
                .collect(),
            cube_roots: values.iter().map(|value| value.cbrt()).collect(),
            values: values.iter().copied().collect(),
        }
    }

    /// With as many predictions, in the same order.
    pub(crate) fn compare(&self, predicted: impl IntoIterator<Item = f64>) -> Comparison {
        let predicted: Vec<f64> = predicted.into_iter().collect();
        let lit = self.values.iter().zip(&self.cosines);
        Comparison {
            log_cosine: predicted
                .iter()
                .zip(lit)
                .map(|(&f, (&g, &cosine))| log_distance(f * cosine, g * cosine))
                .collect(),
            truth: self.values.clone(),
            predicted_roots: predicted.iter().map(|value| value.cbrt()).collect(),
            truth_roots: self.cube_roots.clone(),
            predicted,
        }
    }
}

/// Predictions beside the truth, in the forms that the measures take.
#[derive(Debug, Clone, Default)]
pub(crate) struct Comparison {
    predicted: Vec<f64>,
    truth: Vec<f64>,
    /// $|\ln(1 + f \cos\theta_o) - \ln(1 + g \cos\theta_o)|$.
    log_cosine: Vec<f64>,
    predicted_roots: Vec<f64>,
    truth_roots: Vec<f64>,
}

impl Comparison {
    /// Appends the rows `places` of `other`.
    pub(crate) fn extend(&mut self, other: &Self, places: &[usize]) {
        let add = |own: &mut Vec<f64>, other: &[f64]| {
            own.extend(places.iter().map(|&place| other[place]));
        };
        add(&mut self.predicted, &other.predicted);
        add(&mut self.truth, &other.truth);
        add(&mut self.log_cosine, &other.log_cosine);
        add(&mut self.predicted_roots, &other.predicted_roots);
        add(&mut self.truth_roots, &other.truth_roots);
    }

    /// # Errors
    /// [`elm::Error`] where there is nothing to compare, or a number is not finite.
    pub(crate) fn metrics(&self) -> Result<Metrics> {
        let (p, t) = (aview1(&self.predicted), aview1(&self.truth));
        let rmse = metrics::rmse(&p, &t)?;
        let black = Array1::zeros(t.len());
        let scale = metrics::rmse(&black, &t)?;
        let roots = (aview1(&self.predicted_roots), aview1(&self.truth_roots));
        Ok(Metrics {
            rmse,
            mae: metrics::mae(&p, &t)?,
            correlation: metrics::correlation(&p, &t)?,
            relative_rmse: (scale > 0.0).then(|| rmse / scale),
            log_cosine_mae: self.log_cosine.iter().sum::<f64>() / t.len() as f64,
            cube_root_rmse: metrics::rmse(&roots.0, &roots.1)?,
        })
    }
}

/// $|\ln(1 + f) - \ln(1 + g)|$ with what has no logarithm taken for the most negative number that
/// has one, as one logarithm of $1 + |f - g| / (1 + \min(f, g))$.
fn log_distance(f: f64, g: f64) -> f64 {
    // `max` would turn a NaN into a number.
    let bounded = |x: f64| {
        let least = f64::EPSILON - 1.0;
        if x < least { least } else { x }
    };
    let (f, g) = (bounded(f), bounded(g));
    let growth = (f - g).abs() / (1.0 + f.min(g));
    if growth == f64::INFINITY {
        return (f.ln_1p() - g.ln_1p()).abs();
    }
    growth.ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use elm_datasets::geometry::cartesian;
    use ndarray::{Array2, array};

    fn seen_at(theta_o: f64) -> DirectionPair {
        DirectionPair {
            incident: cartesian(0.2, 0.0),
            outgoing: cartesian(theta_o, 1.0),
        }
    }

    #[test]
    fn figures_are_those_computed_by_hand() {
        let pairs = [seen_at(0.0), seen_at(60_f64.to_radians())];
        let metrics = Metrics::of(
            &pairs,
            array![[1.0], [8.0]].view(),
            array![[0.0], [1.0]].view(),
        )
        .unwrap();
        // Errors 1 and 7; truth 0 and 1.
        assert_abs_diff_eq!(metrics.rmse, 5.0, epsilon = 1e-14);
        assert_abs_diff_eq!(metrics.mae, 4.0, epsilon = 1e-14);
        assert_abs_diff_eq!(
            metrics.relative_rmse.unwrap(),
            50_f64.sqrt(),
            epsilon = 1e-13
        );
        // cos 60 degrees is 1/2: ln 2 - ln 1, and ln 5 - ln 1.5.
        let expected = (2_f64.ln() + (5.0 / 1.5_f64).ln()) / 2.0;
        assert_abs_diff_eq!(metrics.log_cosine_mae, expected, epsilon = 1e-14);
        // Cube roots 1 and 2 against 0 and 1.
        assert_abs_diff_eq!(metrics.cube_root_rmse, 1.0, epsilon = 1e-14);
        assert_abs_diff_eq!(metrics.correlation.unwrap(), 1.0, epsilon = 1e-14);
    }

    #[test]
    fn perfect_predictions_have_no_error_and_black_truth_no_relative_one() {
        let pairs = [seen_at(0.3), seen_at(1.0)];
        let truth = array![[0.1, 0.2], [0.3, 0.0]];
        let metrics = Metrics::of(&pairs, truth.view(), truth.view()).unwrap();
        assert_eq!(
            (metrics.rmse, metrics.log_cosine_mae, metrics.cube_root_rmse),
            (0.0, 0.0, 0.0)
        );
        let black = Array2::zeros((2, 2));
        let metrics = Metrics::of(&pairs, truth.view(), black.view()).unwrap();
        assert_eq!((metrics.relative_rmse, metrics.correlation), (None, None));
        let metrics = Metrics::of(&pairs, black.view(), truth.view()).unwrap();
        assert_abs_diff_eq!(metrics.relative_rmse.unwrap(), 1.0, epsilon = 1e-15);
    }

    #[test]
    fn hugely_negative_predictions_have_finite_measures_and_nan_is_an_error() {
        let pairs = [seen_at(0.0)];
        let of = |value| Metrics::of(&pairs, array![[value]].view(), array![[0.1]].view());
        assert!(of(-3.0).unwrap().log_cosine_mae.is_finite());
        let error = of(f64::NAN).unwrap_err().to_string();
        assert!(error.contains("not finite"), "{error}");
    }

    #[test]
    fn one_logarithm_says_what_the_difference_of_two_does() {
        let numbers = [-3.0, -1.0, -0.9, 0.0, 1e-300, 0.1, 0.3, 7.0, 1e12, f64::MAX];
        let log = |x: f64| x.max(f64::EPSILON - 1.0).ln_1p();
        for (f, g) in numbers.iter().flat_map(|&f| numbers.map(|g| (f, g))) {
            let expected = (log(f) - log(g)).abs();
            assert_abs_diff_eq!(log_distance(f, g), expected, epsilon = 1e-13);
        }
        assert!(log_distance(f64::NAN, 0.0).is_nan() && log_distance(0.0, f64::NAN).is_nan());
    }

    #[test]
    fn shapes_that_do_not_fit_are_errors() {
        let (pairs, one) = ([seen_at(0.0)], Array2::<f64>::zeros((1, 1)));
        for (pairs, predicted, truth) in [
            (&pairs[..], Array2::zeros((1, 2)), one.clone()),
            (&pairs[..], Array2::zeros((2, 1)), one.clone()),
            (&[][..], one.clone(), one.clone()),
            (&[][..], Array2::zeros((0, 1)), Array2::zeros((0, 1))),
            (&pairs[..], Array2::zeros((1, 0)), Array2::zeros((1, 0))),
        ] {
            assert!(Metrics::of(pairs, predicted.view(), truth.view()).is_err());
        }
    }

    #[test]
    fn means_and_deviations_leave_out_what_does_not_exist() {
        let pairs = [seen_at(0.0)];
        let single = Metrics::of(&pairs, array![[0.2]].view(), array![[0.1]].view()).unwrap();
        let with = Metrics {
            correlation: Some(0.5),
            rmse: 0.3,
            ..single
        };
        let mean = Metrics::mean(&[single, with]).unwrap();
        assert_eq!(mean.correlation, Some(0.5));
        assert_abs_diff_eq!(mean.rmse, 0.2, epsilon = 1e-15);
        assert_eq!(Metrics::mean(&[]), None);
        // Two values apart by d deviate by d / sqrt 2.
        let deviation = Metrics::deviation(&[single, with]).unwrap();
        assert_abs_diff_eq!(deviation.rmse, 0.2 / 2_f64.sqrt(), epsilon = 1e-15);
        assert_eq!(deviation.correlation, None);
        assert_eq!(Metrics::deviation(&[single]), None);
    }
}
