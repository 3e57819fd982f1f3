//! Measurements of one material: pairs of directions with a value per channel.

use ndarray::Array2;

use crate::geometry::DirectionPair;

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
    pub directions: Vec<DirectionPair>,
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
