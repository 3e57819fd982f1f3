//! A page to look at: a sphere, the lobes, the error and the size of every material, and a sphere
//! whose shading is the [exported](crate::export) network running in the browser.
//!
//! [`write()`] makes one HTML file with the networks inside and one picture per material beside it.
//! Nothing is loaded from anywhere else, so the folder can be opened from a disk.

mod lobes;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::batch::Packed;
use crate::error::{Error, Result};
use crate::export::{Language, evaluator};
use crate::file;
use crate::fit::Model;
use crate::model::BrdfModel;
use crate::render::{
    LoadError, LoadedMaterial, Material, MaterialLoader, Options, Rendering, Scene, render,
};

/// A material to show.
#[derive(Debug, Clone)]
pub struct GalleryItem {
    /// What it is called.
    pub name: String,
    /// Where its measurements come from.
    pub origin: String,
    /// The learnt material.
    pub model: BrdfModel,
    /// Its RMSE in 1/sr on measurements held out, where it is known.
    pub held_out: Option<f64>,
}

/// The usual size of a picture, in pixels across and down.
pub const PICTURE_SIZE: u32 = 320;
/// Pixels across and down of what the page shows to a test.
const TEST_SIZE: u32 = 64;
/// Half the height of the view of a sphere of radius 1.
const HALF_HEIGHT: f64 = 1.12;
/// Towards the light, at first.
const LIGHT: [f64; 3] = [-0.6, 0.7, 1.0];
/// Irradiance of the light, in all channels.
const IRRADIANCE: f64 = 2.6;

/// What the page's script reads of an exhibit.
#[derive(Serialize)]
struct Card {
    name: String,
    origin: String,
    note: String,
    facts: Vec<(&'static str, String)>,
    /// File of the picture.
    picture: String,
    /// An SVG element.
    lobes: String,
    glsl: String,
    /// Largest value that is shown, as the renderer has it.
    ceiling: f64,
}

/// What the page's script reads of the scene.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Settings {
    intro: String,
    light: [f64; 3],
    irradiance: f64,
    half_height: f64,
    test_size: u32,
}

/// The scene that a picture shows, and the page's sphere at first: `viewer` and `up` are the
/// camera's directions, `light` is towards the light.
///
/// # Errors
/// None with finite directions; [`Error::Scene`] with others.
pub fn sphere(
    size: u32,
    samples: u32,
    viewer: [f64; 3],
    up: [f64; 3],
    light: [f64; 3],
) -> Result<Scene<NoTable>> {
    let position = viewer.map(|c| 5.0 * c);
    let text = format!(
        "[image]\nwidth = {size}\nheight = {size}\nsamples = {samples}\n\
         [camera]\nposition = {position:?}\ntarget = [0, 0, 0]\nup = {up:?}\nheight = {height}\n\
         [material.model]\n\
         [[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = 'model'\n\
         [[directional]]\ntowards = {light:?}\n\
         irradiance = [{IRRADIANCE}, {IRRADIANCE}, {IRRADIANCE}]\n",
        height = 2.0 * HALF_HEIGHT
    );
    Ok(Scene::parse(&text, Path::new("gallery"))?)
}

/// The material of [`sphere`], of which there is nothing to say.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoTable {}

/// The one model of [`sphere`].
pub struct SingleMaterial<'a>(
    /// The model.
    pub &'a BrdfModel,
);

impl MaterialLoader<NoTable> for SingleMaterial<'_> {
    fn load(&self, _: &NoTable, _: &Path) -> Result<LoadedMaterial, LoadError> {
        let packed = Packed::<f64>::new(&self.0.in_color()?)?;
        Ok(LoadedMaterial::new(Box::new(packed), ""))
    }
}

/// Writes `index.html` and a picture of each exhibit into a folder, which is made if it is not
/// there. Pictures are `size` pixels across and down; `done` is told how many exhibits are
/// finished.
///
/// # Errors
/// [`Error::Write`] naming the file; [`Error::Export`] for a model that cannot be exported, and
/// whatever rendering reports.
pub fn write(
    dir: &Path,
    items: &[GalleryItem],
    size: u32,
    mut done: impl FnMut(usize),
) -> Result<()> {
    file::folder(dir)?;
    let mut cards = Vec::with_capacity(items.len());
    for (index, item) in items.iter().enumerate() {
        let picture = format!("sphere-{:02}.png", index + 1);
        let scene = sphere(size, 16, [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], LIGHT)?;
        let rendering = render(
            &scene,
            &SingleMaterial(&item.model),
            Options::default(),
            &|_, _| {},
        )?;
        let path = dir.join(&picture);
        file::replace(&path, &rendering.encode(Rendering::format(&path)?)?)?;
        cards.push(card(item, picture)?);
        done(index + 1);
    }
    let page = page(&cards, items)?;
    file::replace(&dir.join("index.html"), page.as_bytes())
}

fn card(item: &GalleryItem, picture: String) -> Result<Card> {
    let GalleryItem {
        name,
        origin,
        model,
        held_out,
    } = item;
    let shown = model.in_color()?;
    let material = Material::new(Box::new(shown.clone()), [1.0; 3], false)?;
    let glsl = evaluator(model, Language::Glsl, "shown")?;
    let groups = model.network().hidden().groups().iter();
    let neurons: Vec<String> = groups
        .map(|group| format!("{} {} neurons", group.neurons(), group.activation()))
        .collect();
    let size = format!("{} numbers per channel", model.floats_per_channel());
    let mut facts = vec![
        ("Network", neurons.join(", ")),
        ("Inputs", model.features().inputs().join(", ")),
        ("Size", size),
        ("As GLSL", format!("{} kB", glsl.len().div_ceil(1000))),
        (
            "Largest albedo",
            format!("{:.2}", material.largest_albedo()),
        ),
    ];
    if let Some(error) = held_out {
        facts.insert(0, ("Held-out RMSE", format!("{error:.4} per sr")));
    }
    let note = match held_out {
        Some(error) => format!("RMSE {error:.4}/sr, {} numbers", model.floats_per_channel()),
        None => format!("{} numbers", model.floats_per_channel()),
    };
    Ok(Card {
        name: name.clone(),
        origin: origin.clone(),
        note,
        facts,
        picture,
        lobes: lobes::draw(&shown)?,
        glsl,
        ceiling: material.max_value()[0],
    })
}

fn page(cards: &[Card], items: &[GalleryItem]) -> Result<String> {
    let length = LIGHT.iter().map(|c| c * c).sum::<f64>().sqrt();
    let mut origins: Vec<&str> = items.iter().map(|e| e.origin.as_str()).collect();
    origins.sort_unstable();
    origins.dedup();
    let settings = Settings {
        intro: format!(
            "Reflectance learnt from measurements by networks with one random layer. {}. The \
             sphere is shaded by the network itself, running on your graphics card: drag to move \
             the light or the view.",
            origins.join("; ")
        ),
        light: LIGHT.map(|c| c / length),
        irradiance: IRRADIANCE,
        half_height: HALF_HEIGHT,
        test_size: TEST_SIZE,
    };
    Ok(include_str!("page.html")
        .replacen("SCENE", &script(&settings)?, 1)
        .replacen("EXHIBITS", &script(&cards)?, 1))
}

/// As a value in a script; no text in it can end the script.
fn script(value: &impl Serialize) -> Result<String> {
    let json = serde_json::to_string(value).map_err(|error| Error::Write {
        path: "index.html".into(),
        reason: error.into(),
    })?;
    Ok(json.replace("</", "<\\/").replace("<!--", "<\\!--"))
}
