//! The color of a spectrum of reflectance: linear sRGB under daylight.
//!
//! A reflectance $f(\lambda)$ has the tristimulus values
//!
//! $$ X = k \sum_\lambda S(\lambda)\\, \bar x(\lambda)\\, f(\lambda),\quad
//!    k = 1 / \sum_\lambda S(\lambda)\\, \bar y(\lambda) $$
//!
//! and $Y$, $Z$ alike, with the color-matching functions of the CIE 1931 standard observer (2 degrees) and
//! the standard illuminant D65, by sums every 5 nm from 380 to 780 nm (ISO/CIE 11664-3:2019). Between the
//! wavelengths that were measured $f$ is linear; beyond the first and the last it is what it is there.
//! Linear sRGB follows by the primaries of IEC 61966-2-1. Its white is taken to be that of the same sums, so
//! that a reflectance which is the same at all wavelengths is grey, of that value.
//!
//! Colors more saturated than a screen can show have a negative part, which [`SpectralColor::rgb`] leaves
//! and which pictures cut off.

// Formulas are not code.
#![allow(clippy::doc_markdown)]

mod tables;

use ndarray::{Array2, ArrayView2, ArrayViewMut2};

use crate::brdf::{Brdf, EvalError, check_arguments};
use crate::geometry::DirectionPair;
use crate::{Samples, channel};
use tables::{FIRST, OBSERVER_AND_D65, STEP};

/// The wavelengths in nm that a spectrum must reach, and the widest gap between two of them there.
const NEEDED: (f64, f64) = (450.0, 650.0);
const WIDEST_GAP: f64 = 100.0;
/// Chromaticities (x, y) of the primaries of sRGB.
const PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];

/// Why a spectrum has no color.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// Wavelengths that say too little of what is visible.
    #[error(
        "wavelengths from {first} to {last} nm have no color: expected some up to {} and from {} nm, no more \
         than {WIDEST_GAP} nm apart between, found {}",
        NEEDED.0,
        NEEDED.1,
        match gap {
            Some((from, to)) => format!("none between {from} and {to} nm"),
            None => "none there".to_owned(),
        }
    )]
    Invisible {
        /// The shortest.
        first: f64,
        /// The longest.
        last: f64,
        /// Between which there is too wide a gap, where that is what is wrong.
        gap: Option<(f64, f64)>,
    },
    /// Wavelengths that are not all different, positive and finite.
    #[error("expected wavelengths that are positive and all different, found {found} nm")]
    Wavelength {
        /// The first that is not.
        found: f64,
    },
}

/// What each wavelength of a spectrum adds to its color.
///
/// ```
/// use elm_datasets::color::SpectralColor;
///
/// let wavelengths: Vec<f64> = (0..16).map(|k| 400.0 + 20.0 * f64::from(k)).collect();
/// let color = SpectralColor::new(&wavelengths)?;
/// let grey = color.rgb(&[0.25; 16]);
/// assert!(grey.iter().all(|part| (part - 0.25).abs() < 1e-12));
/// # Ok::<(), elm_datasets::color::Problem>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralColor {
    weights: Vec<[f64; 3]>,
}

impl SpectralColor {
    /// The names of the channels that a color has.
    pub const CHANNELS: [&'static str; 3] = ["red", "green", "blue"];

    /// For spectra at these wavelengths in nm, in any order.
    ///
    /// # Errors
    /// [`Problem`] for wavelengths that are no spectrum, or that leave out what is visible.
    pub fn new(wavelengths: &[f64]) -> Result<Self, Problem> {
        let mut order: Vec<usize> = (0..wavelengths.len()).collect();
        order.sort_by(|&a, &b| wavelengths[a].total_cmp(&wavelengths[b]));
        let sorted: Vec<f64> = order.iter().map(|&place| wavelengths[place]).collect();
        check(&sorted)?;
        let mut xyz = vec![[0.0; 3]; wavelengths.len()];
        for (row, &[x, y, z, power]) in OBSERVER_AND_D65.iter().enumerate() {
            let at = FIRST + STEP * row as f64;
            let above = sorted.partition_point(|&nm| nm <= at);
            let (low, high) = (above.saturating_sub(1), above.min(sorted.len() - 1));
            let share = if high > low {
                (at - sorted[low]) / (sorted[high] - sorted[low])
            } else {
                0.0
            };
            for (place, weight) in [(low, 1.0 - share), (high, share)] {
                let sums = &mut xyz[order[place]];
                for (sum, part) in sums.iter_mut().zip([x, y, z]) {
                    *sum += weight * power * part;
                }
            }
        }
        let mut white = [0.0; 3];
        for part in &xyz {
            white = std::array::from_fn(|k| white[k] + part[k]);
        }
        let to_rgb = inverse(primaries(white));
        let weights = xyz.iter().map(|xyz| apply(&to_rgb, *xyz)).collect();
        Ok(Self { weights })
    }

    /// For channels that are [a spectrum](channel::spectrum); `None` where they are none.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn of(channels: &[String]) -> Result<Option<Self>, Problem> {
        channel::spectrum(channels)
            .map(|nm| Self::new(&nm))
            .transpose()
    }

    /// What each wavelength adds to red, green and blue where its reflectance is 1.
    #[must_use]
    pub fn weights(&self) -> &[[f64; 3]] {
        &self.weights
    }

    /// Linear red, green and blue of a spectrum; one with a value missing lacks what that would add.
    #[must_use]
    pub fn rgb(&self, spectrum: &[f64]) -> [f64; 3] {
        let mut rgb = [0.0; 3];
        for (value, weights) in spectrum.iter().zip(&self.weights) {
            for (sum, weight) in rgb.iter_mut().zip(weights) {
                *sum += value * weight;
            }
        }
        rgb
    }

    /// The same of each row of `values`, what is negative cut off.
    #[must_use]
    pub fn visible(&self, values: ArrayView2<'_, f64>) -> Array2<f64> {
        let mut colors = Array2::zeros((values.nrows(), 3));
        for (mut to, from) in colors.rows_mut().into_iter().zip(values.rows()) {
            for (to, part) in to.iter_mut().zip(self.rgb(&from.to_vec())) {
                *to = part.max(0.0);
            }
        }
        colors
    }
}

impl Samples {
    /// The same as [colors](self) where the channels are a spectrum; unchanged where they are none.
    ///
    /// # Errors
    /// As for [`SpectralColor::new`].
    pub fn in_color(self) -> Result<Self, Problem> {
        Ok(match SpectralColor::of(&self.channels)? {
            None => self,
            Some(color) => Self {
                values: color.visible(self.values.view()),
                channels: SpectralColor::CHANNELS.map(str::to_owned).to_vec(),
                directions: self.directions,
            },
        })
    }
}

/// The colors of a reflectance of which each channel is a wavelength.
pub struct Colored<B> {
    brdf: B,
    color: SpectralColor,
}

impl<B: Brdf> Colored<B> {
    /// `color` must be that of the channels of `brdf`.
    #[must_use]
    pub fn new(brdf: B, color: SpectralColor) -> Self {
        Self { brdf, color }
    }
}

impl<B: Brdf> Brdf for Colored<B> {
    fn channels(&self) -> usize {
        3
    }

    fn is_isotropic(&self) -> bool {
        self.brdf.is_isotropic()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        mut values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        check_arguments(pairs, &values, 3)?;
        values.assign(&self.color.visible(self.brdf.eval(pairs)?.view()));
        Ok(())
    }
}

/// Wavelengths in ascending order.
fn check(sorted: &[f64]) -> Result<(), Problem> {
    let wrong = |&&nm: &&f64| !(nm > 0.0 && nm.is_finite());
    let twice = sorted.windows(2).find(|two| two[0] >= two[1]);
    if let Some(&found) = sorted.iter().find(wrong).or(twice.map(|two| &two[1])) {
        return Err(Problem::Wavelength { found });
    }
    let (first, last) = match sorted {
        [first, .., last] => (*first, *last),
        _ => (f64::INFINITY, 0.0),
    };
    let in_sight = |two: &&[f64]| two[1] > NEEDED.0 && two[0] < NEEDED.1;
    let gap = sorted
        .windows(2)
        .filter(in_sight)
        .find(|two| two[1] - two[0] > WIDEST_GAP)
        .map(|two| (two[0], two[1]));
    if first > NEEDED.0 || last < NEEDED.1 || gap.is_some() {
        return Err(Problem::Invisible { first, last, gap });
    }
    Ok(())
}

type Matrix = [[f64; 3]; 3];

/// The tristimulus values, by columns, of the primaries that add up to `white`.
fn primaries(white: [f64; 3]) -> Matrix {
    let xyz = PRIMARIES.map(|[x, y]| [x / y, 1.0, (1.0 - x - y) / y]);
    let columns = std::array::from_fn(|row| xyz.map(|primary| primary[row]));
    let amounts = apply(&inverse(columns), white);
    columns.map(|row| std::array::from_fn(|k| row[k] * amounts[k]))
}

fn apply(matrix: &Matrix, vector: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum())
}

/// By cofactors: the matrices here are those of primaries, far from singular.
fn inverse(m: Matrix) -> Matrix {
    let cofactor = |row: usize, column: usize| {
        let (r, s) = ((row + 1) % 3, (row + 2) % 3);
        let (c, d) = ((column + 1) % 3, (column + 2) % 3);
        m[r][c] * m[s][d] - m[r][d] * m[s][c]
    };
    let determinant: f64 = (0..3)
        .map(|column| m[0][column] * cofactor(0, column))
        .sum();
    std::array::from_fn(|row| std::array::from_fn(|column| cofactor(column, row) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn steps(first: f64, step: f64, count: u32) -> Vec<f64> {
        (0..count).map(|k| first + step * f64::from(k)).collect()
    }

    #[test]
    fn the_white_of_the_tables_is_that_of_d65() {
        // ISO/CIE 11664-2: x = 0.31272, y = 0.32903 for D65 and the 2 degree observer, by sums at 1 nm.
        let mut sums = [0.0; 3];
        for [x, y, z, power] in OBSERVER_AND_D65 {
            for (sum, part) in sums.iter_mut().zip([x, y, z]) {
                *sum += power * part;
            }
        }
        let total: f64 = sums.iter().sum();
        assert_abs_diff_eq!(sums[0] / total, 0.31272, epsilon = 2e-5);
        assert_abs_diff_eq!(sums[1] / total, 0.32903, epsilon = 2e-5);
    }

    #[test]
    fn the_matrix_of_srgb_is_the_published_one() {
        // IEC 61966-2-1, with the white that it states to four digits.
        let (x, y) = (0.3127, 0.3290);
        let matrix = inverse(primaries([x / y, 1.0, (1.0 - x - y) / y]));
        let expected = [
            [3.2406, -1.5372, -0.4986],
            [-0.9689, 1.8758, 0.0415],
            [0.0557, -0.2040, 1.0570],
        ];
        for (row, expected) in matrix.iter().zip(expected) {
            for (&found, expected) in row.iter().zip(expected) {
                // Of a matrix printed with four decimals, itself made of one rounded to four.
                assert_abs_diff_eq!(found, expected, epsilon = 5e-4);
            }
        }
    }

    #[test]
    fn a_spectrum_that_is_linear_in_wavelength_has_one_color_however_it_is_sampled() {
        let linear = |nm: &f64| 0.1 + (nm - 350.0) / 1000.0;
        let of = |wavelengths: &[f64]| {
            let color = SpectralColor::new(wavelengths).unwrap();
            color.rgb(&wavelengths.iter().map(linear).collect::<Vec<_>>())
        };
        let fine = of(&steps(360.0, 1.0, 441));
        let mut mixed = steps(380.0, 80.0, 6);
        mixed.reverse();
        for (a, b) in fine.iter().zip(of(&mixed)) {
            assert_abs_diff_eq!(*a, b, epsilon = 1e-12);
        }
    }

    #[test]
    fn long_waves_are_red_and_short_ones_blue() {
        let wavelengths = steps(400.0, 20.0, 16);
        let color = SpectralColor::new(&wavelengths).unwrap();
        let only = |from: f64, to: f64| {
            let spectrum = wavelengths
                .iter()
                .map(|nm| f64::from(u8::from((from..to).contains(nm))));
            color.rgb(&spectrum.collect::<Vec<_>>())
        };
        let [r, g, b] = only(600.0, 701.0);
        assert!(r > 0.5 && g < 0.2 && b < 0.2, "{r} {g} {b}");
        let [r, g, b] = only(400.0, 500.0);
        assert!(b > 0.5 && r < 0.2 && g < 0.2, "{r} {g} {b}");
    }

    #[test]
    fn what_leaves_out_the_visible_has_no_color() {
        for (wavelengths, text) in [
            (steps(900.0, 50.0, 8), "from 900 to 1250 nm"),
            (steps(400.0, 20.0, 6), "from 400 to 500 nm"),
            (
                vec![400.0, 420.0, 640.0, 700.0],
                "none between 420 and 640 nm",
            ),
            (vec![400.0, 500.0, 500.0, 700.0], "found 500 nm"),
            (vec![400.0, f64::NAN, 500.0, 700.0], "found NaN nm"),
            (Vec::new(), "no color"),
        ] {
            let problem = SpectralColor::new(&wavelengths).unwrap_err().to_string();
            assert!(problem.contains(text), "{problem}");
        }
    }
}
