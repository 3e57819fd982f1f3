//! The materials of a scene, each loaded when it is first needed.

use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Instant;

use crate::error::{Error, Place, Result};
use crate::loader::{LoadError, LoadedMaterial, MaterialLoader};
use crate::material::Material;
use crate::scene::Scene;

/// Materials by their index in the scene, in alphabetical order.
pub(crate) struct MaterialCache<'a> {
    slots: Vec<Slot<'a>>,
}

struct Slot<'a> {
    name: &'a str,
    load: Box<dyn Fn() -> Result<LoadedMaterial, LoadError> + Sync + 'a>,
    /// Where the scene describes it.
    place: Place,
    material: OnceLock<CachedMaterial>,
    /// Held while the material is made, so that it is made once.
    making: Mutex<()>,
}

/// A material that has been made.
pub(crate) struct CachedMaterial {
    pub(crate) material: Material,
    /// Of one evaluation.
    pub(crate) multiply_adds: usize,
    pub(crate) origin: String,
    /// What the data call it.
    pub(crate) title: Option<String>,
    /// What was assumed of the data.
    pub(crate) notes: Vec<String>,
    /// How long it took.
    pub(crate) seconds: f64,
}

impl<'a> MaterialCache<'a> {
    pub(crate) fn new<M: Sync>(scene: &'a Scene<M>, loader: &'a dyn MaterialLoader<M>) -> Self {
        let slots = scene.material.iter().map(|(name, table)| Slot {
            name,
            load: Box::new(|| loader.load(table.get_ref(), &scene.beside("".as_ref()))),
            place: scene.place(table),
            material: OnceLock::new(),
            making: Mutex::new(()),
        });
        Self {
            slots: slots.collect(),
        }
    }

    /// A material, made now if it has not been.
    pub(crate) fn get(&self, index: usize) -> Result<&Material> {
        let slot = &self.slots[index];
        if let Some(cached) = slot.material.get() {
            return Ok(&cached.material);
        }
        // The lock guards no data that a panic elsewhere could have left half made.
        let _making = slot.making.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cached) = slot.material.get() {
            return Ok(&cached.material);
        }
        let made = slot.make()?;
        Ok(&slot.material.get_or_init(|| made).material)
    }

    /// Makes every material.
    pub(crate) fn load_all(&self) -> Result<()> {
        (0..self.slots.len()).try_for_each(|index| self.get(index).map(drop))
    }

    /// Those made so far, in alphabetical order.
    pub(crate) fn cached(&self) -> impl Iterator<Item = (&str, Option<&CachedMaterial>)> {
        self.slots
            .iter()
            .map(|slot| (slot.name, slot.material.get()))
    }

    /// What the data call a material, or the scene where it has not been made.
    pub(crate) fn title<'b>(&'b self, name: &'b str) -> &'b str {
        let slot = self.slots.iter().find(|slot| slot.name == name);
        slot.and_then(|slot| slot.material.get())
            .and_then(|cached| cached.title.as_deref())
            .unwrap_or(name)
    }

    /// The distinct origins of those made so far.
    pub(crate) fn origins(&self) -> Vec<String> {
        let mut origins: Vec<String> = self
            .cached()
            .filter_map(|(_, s)| Some(s?.origin.clone()))
            .collect();
        origins.sort_unstable();
        origins.dedup();
        origins
    }
}

impl Slot<'_> {
    fn make(&self) -> Result<CachedMaterial> {
        let start = Instant::now();
        let make = || -> Result<CachedMaterial, LoadError> {
            let loaded = (self.load)()?;
            Ok(CachedMaterial {
                multiply_adds: loaded.multiply_adds,
                material: Material::new(loaded.brdf, loaded.tint, loaded.conserve_energy)?,
                origin: loaded.origin,
                title: loaded.name,
                notes: loaded.notes,
                seconds: start.elapsed().as_secs_f64(),
            })
        };
        make().map_err(|reason| Error::Material {
            place: self.place.clone(),
            name: self.name.to_owned(),
            reason,
        })
    }
}
