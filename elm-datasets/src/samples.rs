//! The common currency: pairs of directions with a reflectance value per channel.

use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// One pair of directions in the frame of the surface, as polar angles in radians.
///
/// `theta` is measured from the surface normal, `phi` around it. `omega_i` points from the surface
/// towards the light, `omega_o` from the surface towards the viewer.
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

/// Reflectance of one material at scattered pairs of directions.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// One pair of directions per row of [`values`](Self::values).
    pub directions: Vec<Directions>,
    /// BRDF in 1/sr without the cosine, shape (rows, channels).
    pub values: Array2<f64>,
    /// Name of each column of [`values`](Self::values).
    pub channels: Vec<String>,
}
