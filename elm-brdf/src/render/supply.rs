//! Where the models of a scene's materials come from.

use std::path::{Path, PathBuf};

use elm_datasets::{
    Directions, Invalid, MaterialId, Measurements, Samples, analytic, curet, synthetic,
};
use ndarray::Array2;

use super::scene;
use crate::brdf::{Brdf, Fit};
use crate::error::{Error, Result};
use crate::geometry::{Pair, pairs};

/// A model and where it comes from, in a word: "CUReT", "stand-in", a file's name, "analytic".
pub struct Supplied {
    /// The model.
    pub brdf: Box<dyn Brdf>,
    /// The data.
    pub origin: String,
}

/// Something that makes the models of materials.
pub trait Supply: Sync {
    /// The model that a scene's entry asks for; its files are relative to `dir`.
    ///
    /// # Errors
    /// Where there is none.
    fn supply(&self, material: &scene::Material, dir: &Path) -> Result<Supplied>;
}

/// Models fitted to CUReT's files, to the stand-in or to files of one's own, and formulas.
pub struct Library {
    /// Folder of CUReT's files; `None` for the stand-in.
    pub curet: Option<PathBuf>,
    /// How models are fitted.
    pub fit: Box<dyn Fit + Send + Sync>,
}

/// The stand-in's seed.
const STAND_IN_SEED: u64 = 1;

impl Library {
    /// What a caption calls measurements.
    fn origin(&self) -> &'static str {
        if self.curet.is_some() {
            "CUReT"
        } else {
            "synthetic stand-in"
        }
    }

    fn id(&self, name: &str) -> Result<MaterialId> {
        match (&self.curet, name.parse()) {
            // A scene made for CUReT renders with the stand-in too, which has names of its own.
            (None, Err(_)) => Ok(synthetic::find(name)?),
            (_, found) => Ok(found?),
        }
    }

    fn measurements(&self, id: MaterialId) -> Result<Measurements> {
        match &self.curet {
            Some(dir) => Ok(curet::read(dir, &[id], Invalid::Clamp)?),
            None => Ok(synthetic::measurements(
                STAND_IN_SEED,
                &[id],
                Invalid::Clamp,
            )),
        }
    }

    fn samples(&self, id: MaterialId) -> Result<Samples> {
        // There is exactly one material, and its rows are the rig's.
        self.measurements(id)?
            .samples(0)
            .ok_or(Error::Elm(elm::Error::Empty {
                what: "measurements",
                rows: 0,
                columns: 0,
            }))
    }

    fn fitted(&self, samples: &Samples) -> Result<Box<dyn Brdf>> {
        self.fit
            .fit(&pairs(&samples.directions), samples.values.view())
    }
}

impl Supply for Library {
    fn supply(&self, material: &scene::Material, dir: &Path) -> Result<Supplied> {
        let given = [
            ("curet", material.curet.is_some()),
            ("measured", material.measured.is_some()),
            ("model", material.model.is_some()),
            ("csv", material.csv.is_some()),
            ("analytic", material.analytic.is_some()),
        ];
        let count = given.iter().filter(|(_, given)| *given).count();
        if count != 1 {
            return Err(Error::MaterialSource { count });
        }
        if let Some(name) = &material.curet {
            let brdf = self.fitted(&self.samples(self.id(name)?)?)?;
            let origin = format!("ELM fitted to {}", self.origin());
            return Ok(Supplied { brdf, origin });
        }
        if let Some(name) = &material.measured {
            let id = self.id(name)?;
            let brdf: Box<dyn Brdf> = match self.curet {
                Some(_) => Box::new(super::interpolate::Interpolated::new(&self.samples(id)?)),
                None => Box::new(Truth(id)),
            };
            let origin = self.origin().to_owned();
            return Ok(Supplied { brdf, origin });
        }
        if let Some(path) = &material.csv {
            let samples = read_csv(&dir.join(path))?;
            let brdf = self.fitted(&samples)?;
            let origin = format!("ELM fitted to {}", path.display());
            return Ok(Supplied { brdf, origin });
        }
        if let Some(path) = &material.model {
            return Err(Error::NoModelFiles { path: path.clone() });
        }
        let brdf = Box::new(Analytic::from_scene(material)?);
        let origin = "analytic".to_owned();
        Ok(Supplied { brdf, origin })
    }
}

/// Samples from a CSV file with columns `theta_i, phi_i, theta_o, phi_o` in radians and one value
/// column or three, in 1/sr without the cosine.
fn read_csv(path: &Path) -> Result<Samples> {
    let table = elm_datasets::csv::Table::read(path)?;
    let angles = ["theta_i", "phi_i", "theta_o", "phi_o"];
    let missing = angles
        .iter()
        .find(|name| !table.columns.iter().any(|c| c == **name));
    if let Some(column) = missing {
        return Err(Error::MissingColumn {
            path: path.to_owned(),
            column,
        });
    }
    let (values, angle_values) = table.split_target(&angles)?;
    let directions = angle_values
        .rows()
        .into_iter()
        .map(|row| Directions {
            theta_i: row[0],
            phi_i: row[1],
            theta_o: row[2],
            phi_o: row[3],
        })
        .collect();
    let channels = table
        .columns
        .iter()
        .filter(|name| !angles.contains(&name.as_str()))
        .cloned()
        .collect();
    Ok(Samples {
        directions,
        values,
        channels,
    })
}

/// A pair in angles.
fn angles(pair: &Pair) -> Directions {
    let polar = |w: [f64; 3]| (w[0].hypot(w[1]).atan2(w[2]), w[1].atan2(w[0]));
    let ((theta_i, phi_i), (theta_o, phi_o)) = (polar(pair.incident), polar(pair.outgoing));
    Directions {
        theta_i,
        phi_i,
        theta_o,
        phi_o,
    }
}

/// A formula of the stand-in, before noise.
struct Truth(MaterialId);

impl Brdf for Truth {
    fn channels(&self) -> usize {
        3
    }

    fn eval(&self, pairs: &[Pair]) -> Result<Array2<f64>> {
        let mut values = Array2::zeros((pairs.len(), 3));
        for (mut row, pair) in values.rows_mut().into_iter().zip(pairs) {
            let truth = synthetic::truth(self.0, &angles(pair));
            row.iter_mut().zip(truth).for_each(|(value, t)| *value = t);
        }
        Ok(values)
    }
}

/// A formula of one channel: a diffuse part and a highlight, from [`elm_datasets::analytic`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Analytic {
    diffuse: Diffuse,
    highlight: Option<Highlight>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Diffuse {
    Lambert { albedo: f64 },
    OrenNayar { albedo: f64, sigma: f64 },
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Highlight {
    Ward { albedo: f64, alpha: f64 },
    Ggx { f0: f64, alpha: f64 },
}

impl Analytic {
    /// A surface that looks equally bright from everywhere.
    #[must_use]
    pub fn lambert(albedo: f64) -> Self {
        Self {
            diffuse: Diffuse::Lambert { albedo },
            highlight: None,
        }
    }

    fn from_scene(material: &scene::Material) -> Result<Self> {
        let name = material.analytic.as_deref().unwrap_or_default();
        let value = |what, given: Option<f64>, default: f64, least: f64, most: f64| {
            let value = given.unwrap_or(default);
            if (least..=most).contains(&value) {
                return Ok(value);
            }
            Err(Error::AnalyticValue {
                what,
                value,
                least,
                most,
            })
        };
        let albedo = value("albedo", material.albedo, 0.5, 0.0, 1.0)?;
        let roughness = value("roughness", material.roughness, 0.3, 1e-3, 2.0)?;
        let specular = value("specular", material.specular, 0.04, 0.0, 1.0)?;
        let (diffuse, highlight) = match name {
            "lambert" => (Diffuse::Lambert { albedo }, None),
            "oren-nayar" => {
                let sigma = roughness;
                (Diffuse::OrenNayar { albedo, sigma }, None)
            }
            "ward" => {
                let highlight = Highlight::Ward {
                    albedo: specular,
                    alpha: roughness,
                };
                (Diffuse::Lambert { albedo }, Some(highlight))
            }
            "ggx" => {
                let highlight = Highlight::Ggx {
                    f0: specular,
                    alpha: roughness,
                };
                (Diffuse::Lambert { albedo }, Some(highlight))
            }
            _ => {
                return Err(Error::UnknownName {
                    what: "formula",
                    name: name.to_owned(),
                    expected: "lambert, oren-nayar, ward, ggx".to_owned(),
                });
            }
        };
        Ok(Self { diffuse, highlight })
    }
}

impl Brdf for Analytic {
    fn channels(&self) -> usize {
        1
    }

    fn eval(&self, pairs: &[Pair]) -> Result<Array2<f64>> {
        Ok(Array2::from_shape_fn((pairs.len(), 1), |(row, _)| {
            let directions = angles(&pairs[row]);
            let diffuse = match self.diffuse {
                Diffuse::Lambert { albedo } => analytic::lambert(&directions, albedo),
                Diffuse::OrenNayar { albedo, sigma } => {
                    analytic::oren_nayar(&directions, albedo, sigma)
                }
            };
            let highlight = match self.highlight {
                None => 0.0,
                Some(Highlight::Ward { albedo, alpha }) => {
                    analytic::ward(&directions, albedo, alpha)
                }
                Some(Highlight::Ggx { f0, alpha }) => analytic::ggx(&directions, f0, alpha),
            };
            diffuse + highlight
        }))
    }
}
