//! The materials of a scene, each made when it is first needed.

use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Instant;

use super::error::SceneError;
use super::material::Material;
use super::scene::Scene;
use super::supply::Supply;
use crate::error::{Error, Result};

/// Materials by their index in the scene, in alphabetical order.
pub(crate) struct Shelf<'a> {
    scene: &'a Scene,
    supply: &'a dyn Supply,
    slots: Vec<Slot<'a>>,
}

struct Slot<'a> {
    name: &'a str,
    material: OnceLock<Stocked>,
    /// Held while the material is made, so that it is made once.
    making: Mutex<()>,
}

/// A material that has been made.
pub(crate) struct Stocked {
    pub(crate) material: Material,
    pub(crate) origin: String,
    /// What the data call it.
    pub(crate) title: Option<String>,
    /// What was assumed of the data.
    pub(crate) notes: Vec<String>,
    /// How long it took.
    pub(crate) seconds: f64,
}

impl<'a> Shelf<'a> {
    pub(crate) fn new(scene: &'a Scene, supply: &'a dyn Supply) -> Self {
        let slot = |name| Slot {
            name,
            material: OnceLock::new(),
            making: Mutex::new(()),
        };
        Self {
            scene,
            supply,
            slots: scene
                .material
                .keys()
                .map(|name| slot(name.as_str()))
                .collect(),
        }
    }

    /// A material, made now if it has not been.
    pub(crate) fn get(&self, index: usize) -> Result<&Material> {
        let slot = &self.slots[index];
        if let Some(stocked) = slot.material.get() {
            return Ok(&stocked.material);
        }
        // The lock guards no data that a panic elsewhere could have left half made.
        let _making = slot.making.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(stocked) = slot.material.get() {
            return Ok(&stocked.material);
        }
        let made = self.make(slot.name)?;
        Ok(&slot.material.get_or_init(|| made).material)
    }

    /// Makes every material.
    pub(crate) fn fill(&self) -> Result<()> {
        (0..self.slots.len()).try_for_each(|index| self.get(index).map(drop))
    }

    fn make(&self, name: &str) -> Result<Stocked> {
        let start = Instant::now();
        let entry = &self.scene.material[name];
        let definition = entry.get_ref();
        let dir = self.scene.beside("".as_ref());
        let make = || -> Result<Stocked> {
            let tint = definition.tint.unwrap_or([1.0; 3]);
            if !tint.iter().all(|c| (0.0..=1e6).contains(c)) {
                return Err(SceneError::Value {
                    place: self.scene.place(entry),
                    what: "tint",
                    found: format!("{tint:?}"),
                    expected: "three numbers from 0 to 1e6",
                }
                .into());
            }
            let supplied = self.supply.supply(definition, &dir)?;
            let material = Material::new(supplied.brdf, tint, definition.conserve_energy)?;
            Ok(Stocked {
                material,
                origin: supplied.origin,
                title: supplied.name,
                notes: supplied.notes,
                seconds: start.elapsed().as_secs_f64(),
            })
        };
        make().map_err(|reason| match reason {
            Error::Scene(reason) => Error::Scene(reason),
            reason => SceneError::Material {
                place: self.scene.place(entry),
                name: name.to_owned(),
                reason: Box::new(reason),
            }
            .into(),
        })
    }

    /// Those made so far, in alphabetical order.
    pub(crate) fn stocked(&self) -> impl Iterator<Item = (&str, Option<&Stocked>)> {
        self.slots
            .iter()
            .map(|slot| (slot.name, slot.material.get()))
    }

    /// What the data call a material, or the scene where it has not been made.
    pub(crate) fn title<'b>(&'b self, name: &'b str) -> &'b str {
        let slot = self.slots.iter().find(|slot| slot.name == name);
        slot.and_then(|slot| slot.material.get())
            .and_then(|stocked| stocked.title.as_deref())
            .unwrap_or(name)
    }

    /// The distinct origins of those made so far.
    pub(crate) fn origins(&self) -> Vec<String> {
        let mut origins: Vec<String> = self
            .stocked()
            .filter_map(|(_, s)| Some(s?.origin.clone()))
            .collect();
        origins.sort_unstable();
        origins.dedup();
        origins
    }
}
