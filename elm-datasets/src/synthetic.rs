//! Synthetic data like CUReT's, from formulas: for tests, for examples, and for whoever has no files.
//!
//! It has CUReT's shape (61 materials, the [rig's](crate::curet::rig) 205 pairs of directions,
//! red, green and blue, values in steps of 0.001) and noise like CUReT's, but materials of its
//! own, made of the [analytic](crate::lobes) models:
//!
//! | numbers | names | made of |
//! |---|---|---|
//! | 1, 5, 9, ..., 57 | Matte 01 to Matte 15 | Oren-Nayar |
//! | 2, 6, 10, ..., 58 | Satin 01 to Satin 15 | Oren-Nayar and a Ward lobe |
//! | 3, 7, 11, ..., 59 | Gloss 01 to Gloss 15 | Oren-Nayar and a GGX lobe |
//! | 4, 8, 12, ..., 60 | Lustre 01 to Lustre 15 | a coloured GGX lobe alone |
//! | 61 | Dark 01 | Oren-Nayar, nearly black, with dark current: some values are negative |
//!
//! Three of the Matte materials (13, 37 and 57) are so dark that some values are zero. The
//! materials are always the same; the seed makes another set of measurements of them. No result on
//! them says anything about real materials.

use std::sync::LazyLock;

use ndarray::Array2;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use crate::Error;
use crate::curet::{MaterialId, rig};
use crate::geometry::DirectionPair;
use crate::lobes::{ggx, oren_nayar, ward};
use crate::measurements::{Invalid, Material, Measurements, Origin};

const CHANNELS: [&str; 3] = ["red", "green", "blue"];
/// Materials with next to no reflectance.
const DARK: [usize; 3] = [13, 37, 57];

/// Relative noise common to the channels of a measurement: texture, registration, lamp.
const COMMON_NOISE: f64 = 0.04;
/// Relative noise of each channel.
const CHANNEL_NOISE: f64 = 0.01;
/// Dark current of the camera in 1/sr, seen on [`OFFSET_MATERIAL`] only.
const OFFSET_NOISE: f64 = 0.002;
const OFFSET_MATERIAL: usize = 61;
/// Values are multiples of one over this.
const STEPS: f64 = 1000.0;

static NAMES: LazyLock<Vec<String>> = LazyLock::new(|| {
    MaterialId::all()
        .map(|id| format!("{} {:02}", Family::of(id).name(), id.index() / 4 % 15 + 1))
        .collect()
});

/// The name of a material of the synthetic data, such as "Matte 01".
#[must_use]
pub fn name(id: MaterialId) -> &'static str {
    &NAMES[id.index()]
}

/// Finds a material of the synthetic data by its number or by its name, of which only letters and
/// digits count, in either case.
///
/// # Errors
/// As for CUReT's names: [`Error::MaterialNumber`], [`Error::AmbiguousMaterial`],
/// [`Error::UnknownMaterial`].
pub fn find(text: &str) -> Result<MaterialId, Error> {
    MaterialId::find(text, &NAMES, &[])
}

/// Measures the materials `ids`, in that order, each once. The same seed gives the same numbers,
/// whatever else is asked for.
#[must_use]
pub fn measurements(seed: u64, ids: &[MaterialId], invalid: Invalid) -> Measurements {
    let directions = rig::directions();
    let mut materials: Vec<Material> = Vec::new();
    for &id in ids {
        if materials.iter().all(|material| material.id != id) {
            let values = measure(seed, id, &directions);
            materials.push(Material::new(id, name(id), values, invalid));
        }
    }
    Measurements::new(Origin::Synthetic { seed }, directions, &CHANNELS, materials)
}

/// The BRDF of a material in 1/sr at one pair of directions, red, green and blue: what is
/// measured, before noise and rounding.
#[must_use]
pub fn truth(id: MaterialId, directions: &DirectionPair) -> [f64; 3] {
    Recipe::of(id).evaluate(directions)
}

/// Values of shape (directions, 3).
fn measure(seed: u64, id: MaterialId, directions: &[DirectionPair]) -> Array2<f64> {
    let recipe = Recipe::of(id);
    let offset = if id.number() == OFFSET_MATERIAL {
        OFFSET_NOISE
    } else {
        0.0
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    // A stream for each material, so that none depends on which others are measured.
    random.set_stream(id.number() as u64);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let mut values = Array2::zeros((directions.len(), CHANNELS.len()));
    for (mut row, pair) in values.rows_mut().into_iter().zip(directions) {
        let common = 1.0 + COMMON_NOISE * normal();
        for (value, exact) in row.iter_mut().zip(recipe.evaluate(pair)) {
            let noisy = exact * (common + CHANNEL_NOISE * normal()) + offset * normal();
            *value = (noisy * STEPS).round() / STEPS;
        }
    }
    values
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Family {
    Matte,
    Satin,
    Gloss,
    Lustre,
    Dark,
}

impl Family {
    fn of(id: MaterialId) -> Self {
        match id.number() {
            OFFSET_MATERIAL => Self::Dark,
            number => [Self::Lustre, Self::Matte, Self::Satin, Self::Gloss][number % 4],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Matte => "Matte",
            Self::Satin => "Satin",
            Self::Gloss => "Gloss",
            Self::Lustre => "Lustre",
            Self::Dark => "Dark",
        }
    }
}

/// The parameters of one material.
struct Recipe {
    family: Family,
    color: [f64; 3],
    sigma: f64,
    alpha: f64,
    lobe: f64,
}

impl Recipe {
    fn of(id: MaterialId) -> Self {
        let number = id.number() as f64;
        // Multiples of the square roots of primes, modulo 1, fill the unit cube evenly.
        let spread =
            |prime: f64, low: f64, high: f64| low + (high - low) * (number * prime.sqrt()).fract();
        let family = Family::of(id);
        let brightness = match id.number() {
            OFFSET_MATERIAL => 0.012,
            number if DARK.contains(&number) => 0.002,
            _ => spread(2.0, 0.1, 0.7),
        };
        let tint = [
            spread(3.0, 0.6, 1.0),
            spread(5.0, 0.5, 1.0),
            spread(7.0, 0.3, 1.0),
        ];
        Self {
            family,
            color: tint.map(|part| part * brightness),
            sigma: spread(11.0, 0.0, 0.8),
            alpha: spread(13.0, 0.3, 0.6),
            // Ward: share of light in the lobe. GGX: reflectance head-on of common dielectrics.
            lobe: if family == Family::Satin {
                brightness * spread(17.0, 0.05, 0.25)
            } else {
                spread(17.0, 0.03, 0.08)
            },
        }
    }

    fn evaluate(&self, directions: &DirectionPair) -> [f64; 3] {
        let base = oren_nayar(directions, 1.0, self.sigma);
        match self.family {
            Family::Matte | Family::Dark => self.color.map(|albedo| albedo * base),
            Family::Satin => {
                let lobe = ward(directions, self.lobe, self.alpha);
                self.color.map(|albedo| albedo * base + lobe)
            }
            Family::Gloss => {
                let lobe = ggx(directions, self.lobe, self.alpha);
                self.color
                    .map(|albedo| albedo * (1.0 - self.lobe) * base + lobe)
            }
            // Dimmed, so that the peaks are not far above CUReT's.
            Family::Lustre => self.color.map(|f0| ggx(directions, 0.3 * f0, self.alpha)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curet::MATERIALS;
    use std::collections::HashSet;

    fn all() -> Vec<MaterialId> {
        MaterialId::all().collect()
    }

    #[test]
    fn it_has_curets_shape_and_names_of_its_own() {
        let set = measurements(1, &all(), Invalid::Keep);
        assert_eq!(set.directions.len(), 205);
        assert_eq!(set.channels, CHANNELS);
        assert_eq!(set.materials.len(), MATERIALS);
        let names: HashSet<_> = set
            .materials
            .iter()
            .map(|material| &material.name)
            .collect();
        assert_eq!(names.len(), MATERIALS);
        for (material, id) in set.materials.iter().zip(all()) {
            assert_eq!(material.values.dim(), (205, 3));
            assert_eq!(find(&material.name).unwrap(), id);
            assert!(material.values.iter().all(|value| value.is_finite()));
        }
        assert_eq!(
            (name(all()[0]), name(all()[59]), name(all()[60])),
            ("Matte 01", "Lustre 15", "Dark 01")
        );
    }

    #[test]
    fn a_subset_has_the_values_of_the_whole_in_the_order_asked_for() {
        let whole = measurements(7, &all(), Invalid::Clamp);
        let ids = [61, 3, 3, 20].map(|number| MaterialId::new(number).unwrap());
        let part = measurements(7, &ids, Invalid::Clamp);
        let numbers: Vec<_> = part
            .materials
            .iter()
            .map(|material| material.id.number())
            .collect();
        assert_eq!(numbers, [61, 3, 20]);
        for material in &part.materials {
            assert_eq!(Some(material), whole.material(material.id));
        }
    }

    #[test]
    fn another_seed_measures_the_same_materials_anew() {
        let ids = [MaterialId::new(1).unwrap()];
        let (one, two) = (
            measurements(1, &ids, Invalid::Keep),
            measurements(2, &ids, Invalid::Keep),
        );
        assert_eq!(one, measurements(1, &ids, Invalid::Keep));
        assert_ne!(one.materials, two.materials);
    }

    #[test]
    fn only_the_last_material_has_negative_values_and_the_dark_ones_have_zeros() {
        let set = measurements(1, &all(), Invalid::Keep);
        for material in &set.materials {
            let number = material.id.number();
            assert_eq!(material.invalid > 0, number == OFFSET_MATERIAL, "{number}");
            if DARK.contains(&number) {
                assert!(
                    material.values.iter().any(|&value| value == 0.0),
                    "{number}"
                );
            }
        }
        let share = set.invalid as f64 / 615.0;
        assert!((0.03..0.2).contains(&share), "{share}");
        assert!(set.materials[60].values.iter().all(|&value| value > -0.02));
    }

    #[test]
    fn the_noise_is_four_percent_of_the_truth() {
        let set = measurements(3, &all(), Invalid::Keep);
        let mut squares = vec![];
        for material in &set.materials {
            for (row, pair) in material.values.rows().into_iter().zip(&set.directions) {
                for (&value, exact) in row.iter().zip(truth(material.id, pair)) {
                    // Where rounding to 0.001 adds nothing worth mentioning.
                    if exact > 0.1 {
                        squares.push((value / exact - 1.0).powi(2));
                    }
                }
            }
        }
        let noise = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!(
            squares.len() > 1000 && (0.038..0.045).contains(&noise),
            "{noise}"
        );
    }

    #[test]
    fn values_are_multiples_of_a_thousandth_of_curets_order_of_magnitude() {
        let set = measurements(1, &all(), Invalid::Clamp);
        for material in &set.materials {
            for &value in &material.values {
                let text = format!("{value:.3}");
                assert_eq!(text.parse::<f64>().unwrap(), value);
                assert!((0.0..8.0).contains(&value), "{} {value}", material.name);
            }
        }
    }
}
