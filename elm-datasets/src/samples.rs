//! Measurements of one material: pairs of directions with a value per channel.

use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// One pair of directions in the frame of the surface, as polar angles in radians.
///
/// `theta` is measured from the surface normal, `phi` around it. `omega_i` points from the surface
/// towards the light, `omega_o` from the surface towards the viewer.
///
/// ```
/// use elm_datasets::Directions;
/// use std::f64::consts::PI;
///
/// let mirror = Directions { theta_i: 0.5, phi_i: 0.0, theta_o: 0.5, phi_o: PI };
/// assert!((mirror.cos_between() - 1.0_f64.cos()).abs() < 1e-15);
/// assert_eq!(mirror.swapped().phi_i, PI);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Directions {
    /// Angle between the normal and the light.
    pub theta_i: f64,
    /// Azimuth of the light.
    pub phi_i: f64,
    /// Angle between the normal and the viewer.
    pub theta_o: f64,
    /// Azimuth of the viewer.
    pub phi_o: f64,
}

impl Directions {
    /// Cosine of the angle between the light and the viewer, in \[-1, 1\].
    #[must_use]
    pub fn cos_between(&self) -> f64 {
        let (sin_i, cos_i) = self.theta_i.sin_cos();
        let (sin_o, cos_o) = self.theta_o.sin_cos();
        let cos = cos_i * cos_o + sin_i * sin_o * (self.phi_i - self.phi_o).cos();
        cos.clamp(-1.0, 1.0)
    }

    /// Light and viewer exchanged. A reciprocal BRDF has the same value for both.
    #[must_use]
    pub fn swapped(&self) -> Self {
        Self {
            theta_i: self.theta_o,
            phi_i: self.phi_o,
            theta_o: self.theta_i,
            phi_o: self.phi_i,
        }
    }
}

/// Reflectance of one material at scattered pairs of directions.
///
/// ```
/// use elm_datasets::scattered::{self, Options};
///
/// let text = "theta_i,phi_i,theta_o,phi_o,r,g\n0.1,0.2,0.3,0.4,1,2\n0.5,-3,1.2,4,3,4\n";
/// let samples = scattered::from_reader(text.as_bytes(), "paint.csv", &Options::default())?;
/// assert_eq!(samples.channels, ["r", "g"]);
/// assert_eq!(samples.values.row(1).to_vec(), [3.0, 4.0]);
/// # Ok::<(), elm_datasets::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// One pair of directions per row of [`values`](Self::values).
    pub directions: Vec<Directions>,
    /// BRDF in 1/sr without the cosine, shape (rows, channels).
    pub values: Array2<f64>,
    /// Name of each column of [`values`](Self::values).
    pub channels: Vec<String>,
}

impl Samples {
    /// The same with these channels alone, in this order: places among those there are.
    pub(crate) fn with_channels(&self, places: &[usize]) -> Self {
        let places: Vec<usize> = places
            .iter()
            .copied()
            .filter(|&place| place < self.channels.len().min(self.values.ncols()))
            .collect();
        Self {
            directions: self.directions.clone(),
            values: self.values.select(ndarray::Axis(1), &places),
            channels: places.iter().map(|&p| self.channels[p].clone()).collect(),
        }
    }

    /// The same with the channels that `wanted` names, in that order, as
    /// [`channel::places`](crate::channel::places) matches them; `None` where one is missing.
    #[must_use]
    pub fn matched(&self, wanted: &[String]) -> Option<Self> {
        let places = crate::channel::places(wanted, &self.channels)?;
        Some(self.with_channels(&places))
    }

    /// The same with red first, then green, then blue, where its three channels are colours or
    /// wavelengths; unchanged where they are not.
    #[must_use]
    pub fn in_rgb_order(self) -> Self {
        match crate::channel::rgb(&self.channels) {
            None | Some([0, 1, 2]) => self,
            Some(places) => self.with_channels(&places),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use std::f64::consts::{FRAC_PI_4, PI};

    #[test]
    fn opposite_azimuths_add_the_polar_angles_and_equal_ones_subtract_them() {
        let pair = Directions {
            theta_i: 0.3,
            phi_i: 0.0,
            theta_o: FRAC_PI_4,
            phi_o: PI,
        };
        assert_relative_eq!(pair.cos_between().acos(), FRAC_PI_4 + 0.3, epsilon = 1e-14);
        let pair = Directions { phi_o: 0.0, ..pair };
        assert_relative_eq!(pair.cos_between().acos(), FRAC_PI_4 - 0.3, epsilon = 1e-14);
    }

    #[test]
    fn swapping_twice_changes_nothing_and_once_keeps_the_angle_between() {
        let pair = Directions {
            theta_i: 0.3,
            phi_i: 1.0,
            theta_o: 1.2,
            phi_o: -2.0,
        };
        assert_eq!(pair.swapped().swapped(), pair);
        assert_eq!(pair.swapped().cos_between(), pair.cos_between());
    }
}
