//! The models, each as a weighted sum of terms whose shape has a few parameters of its own.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, PI};

use elm_datasets::lobes::Cosines;

/// The most shape parameters that a model has.
pub(super) const MAX_SHAPES: usize = 4;
/// The most terms that a model has.
pub(super) const MAX_TERMS: usize = 3;

/// An analytic model of reflectance; formulas and sources are those of
/// [`elm_datasets::lobes`].
///
/// Weights are free but for their sign: albedos above 1 are allowed, as measurements are not
/// calibrated to better than that. The reflectance $f_0$ of a microfacet surface follows from
/// two weights, as $F$ is linear in it: $w (f_0 + (1 - f_0) S) = a + b S$ with Schlick's $S$.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Analytic {
    /// Lambert's: the same in all directions.
    Lambert,
    /// The paper's equations 2 to 4.
    Phong,
    /// The paper's equation 4 with the half vector of equation 5, as equation 6 must read.
    BlinnPhong,
    /// Oren and Nayar's rough diffuse surface.
    OrenNayar,
    /// A diffuse part and Ward's lobe.
    Ward,
    /// A diffuse part and microfacets with the GGX distribution.
    GgxLambert,
    /// Oren and Nayar's diffuse part and microfacets with the GGX distribution.
    GgxOrenNayar,
    /// A diffuse part and Ward's lobe with a direction along the surface.
    AnisotropicWard,
    /// A diffuse part and microfacets with the GGX distribution, rougher in one direction than in the other.
    AnisotropicGgx,
    /// A diffuse part and one of Lafortune's lobes.
    Lafortune,
    /// A diffuse part and two of Lafortune's lobes.
    Lafortune2,
}

/// A shape parameter: its name, bounds, and how a grid of starts covers them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Name, as the formula has it.
    pub name: &'static str,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Whether equal steps are equal factors.
    pub(super) logarithmic: bool,
    /// Number of grid points.
    pub(super) steps: usize,
}

impl Shape {
    const fn linear(name: &'static str, low: f64, high: f64, steps: usize) -> Self {
        Self {
            name,
            low,
            high,
            logarithmic: false,
            steps,
        }
    }

    const fn logarithmic(name: &'static str, low: f64, high: f64, steps: usize) -> Self {
        Self {
            name,
            low,
            high,
            logarithmic: true,
            steps,
        }
    }

    /// The value at a place from 0 (the smallest) to 1 (the largest).
    pub(super) fn at(&self, place: f64) -> f64 {
        let value = if self.logarithmic {
            self.low * (self.high / self.low).powf(place)
        } else {
            self.low + place * (self.high - self.low)
        };
        value.clamp(self.low, self.high)
    }
}

const EXPONENT: Shape = Shape::logarithmic("exponent", 0.1, 2000.0, 14);
const SIGMA: Shape = Shape::linear("sigma", 0.0, FRAC_PI_2, 10);
const ALPHA: Shape = Shape::logarithmic("alpha", 0.02, 1.0, 12);
const WARD_ALPHA: Shape = Shape::logarithmic("alpha", 0.02, 3.0, 14);
const DIRECTION: Shape = Shape::linear("direction", -FRAC_PI_2, FRAC_PI_2, 9);
const LOBE: Shape = Shape::logarithmic("exponent", 0.1, 500.0, 8);
// Along, across and the angle from x: coarser, as the grid has all three.
const DIRECTED: [Shape; 3] = [
    Shape::logarithmic("alpha along", 0.02, 1.0, 6),
    Shape::logarithmic("alpha across", 0.02, 1.0, 6),
    Shape::linear("turn", 0.0, PI, 7),
];
// Coarser, as the grid has every pair of lobes.
const OF_TWO: [Shape; 2] = [
    Shape::linear("direction", -FRAC_PI_2, FRAC_PI_2, 7),
    Shape::logarithmic("exponent", 0.1, 500.0, 5),
];

impl Analytic {
    /// Every model, from the simplest.
    pub const ALL: [Self; 11] = [
        Self::Lambert,
        Self::Phong,
        Self::BlinnPhong,
        Self::OrenNayar,
        Self::Ward,
        Self::GgxLambert,
        Self::GgxOrenNayar,
        Self::AnisotropicWard,
        Self::AnisotropicGgx,
        Self::Lafortune,
        Self::Lafortune2,
    ];

    /// The model's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Lambert => "lambert",
            Self::Phong => "phong",
            Self::BlinnPhong => "blinn-phong",
            Self::OrenNayar => "oren-nayar",
            Self::Ward => "ward+lambert",
            Self::GgxLambert => "ggx+lambert",
            Self::GgxOrenNayar => "ggx+oren-nayar",
            Self::AnisotropicWard => "anisotropic-ward+lambert",
            Self::AnisotropicGgx => "anisotropic-ggx+lambert",
            Self::Lafortune => "lafortune-1",
            Self::Lafortune2 => "lafortune-2",
        }
    }

    /// The shape parameters.
    #[must_use]
    pub fn shapes(self) -> &'static [Shape] {
        match self {
            Self::Lambert => &[],
            Self::Phong | Self::BlinnPhong => &[EXPONENT],
            Self::OrenNayar => &[SIGMA],
            Self::Ward => &[WARD_ALPHA],
            Self::GgxLambert => &[ALPHA],
            Self::GgxOrenNayar => &[SIGMA, ALPHA],
            Self::AnisotropicWard | Self::AnisotropicGgx => &DIRECTED,
            Self::Lafortune => &[DIRECTION, LOBE],
            Self::Lafortune2 => &[OF_TWO[0], OF_TWO[1], OF_TWO[0], OF_TWO[1]],
        }
    }

    /// What the weight of each term is: an albedo, or a value in 1/sr for lobes that are not
    /// normalised.
    #[must_use]
    pub fn terms(self) -> &'static [&'static str] {
        match self {
            Self::Lambert | Self::OrenNayar => &["diffuse albedo"],
            Self::Phong | Self::BlinnPhong => &["diffuse", "specular"],
            Self::Ward | Self::AnisotropicWard => &["diffuse albedo", "specular albedo"],
            Self::GgxLambert | Self::GgxOrenNayar | Self::AnisotropicGgx => {
                &["diffuse albedo", "specular f0", "specular 1 - f0"]
            }
            Self::Lafortune => &["diffuse albedo", "lobe"],
            Self::Lafortune2 => &["diffuse albedo", "first lobe", "second lobe"],
        }
    }

    /// Whether exchanging light and viewer changes nothing.
    #[must_use]
    pub fn is_reciprocal(self) -> bool {
        !matches!(self, Self::Phong | Self::BlinnPhong)
    }

    /// Whether turning the surface about its normal changes nothing.
    #[must_use]
    pub fn is_isotropic(self) -> bool {
        !matches!(self, Self::AnisotropicWard | Self::AnisotropicGgx)
    }

    /// The value of each term for these shape parameters.
    pub(super) fn basis(self, angles: &Cosines, shapes: &[f64; MAX_SHAPES]) -> [f64; MAX_TERMS] {
        let [first, second, third, fourth] = *shapes;
        match self {
            Self::Lambert => [FRAC_1_PI, 0.0, 0.0],
            Self::Phong => [1.0, angles.phong(first), 0.0],
            Self::BlinnPhong => [1.0, angles.blinn_phong(first), 0.0],
            Self::OrenNayar => [angles.oren_nayar(first), 0.0, 0.0],
            Self::Ward => [FRAC_1_PI, angles.ward(first), 0.0],
            Self::GgxLambert => {
                let lobe = angles.ggx(first);
                [FRAC_1_PI, lobe, lobe * angles.schlick()]
            }
            Self::GgxOrenNayar => {
                let lobe = angles.ggx(second);
                [angles.oren_nayar(first), lobe, lobe * angles.schlick()]
            }
            Self::AnisotropicWard => {
                let lobe = angles.anisotropic_ward([first, second], third);
                [FRAC_1_PI, lobe, 0.0]
            }
            Self::AnisotropicGgx => {
                let lobe = angles.anisotropic_ggx([first, second], third);
                [FRAC_1_PI, lobe, lobe * angles.schlick()]
            }
            Self::Lafortune => [FRAC_1_PI, angles.lafortune(first, second), 0.0],
            Self::Lafortune2 => [
                FRAC_1_PI,
                angles.lafortune(first, second),
                angles.lafortune(third, fourth),
            ],
        }
    }
}
