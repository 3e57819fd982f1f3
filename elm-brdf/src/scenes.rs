//! The built-in scenes.

use std::fmt::Write;

use crate::published;
use crate::scene_materials::{MaterialTable, Scene, Sheet};
use elm_brdf_render::{Content, Error, Panel};

/// Names of the built-in scenes.
pub const NAMES: [&str; 4] = ["materials", "contact-sheet", "comparison", "mesh"];

/// Materials of the comparison, by CUReT's numbers: rough, shiny, and with a soft highlight.
const COMPARED: [usize; 3] = [1, 15, 25];

/// A built-in scene:
/// - `materials`: a sphere of each of the paper's 15 materials;
/// - `contact-sheet`: one material under a moving light;
/// - `comparison`: interpolated, fitted and analytic side by side, with the differences;
/// - `mesh`: a torus knot in a studio.
///
/// `material` takes the place of the one material
/// of `contact-sheet` and `mesh`, and of the three of `comparison`.
///
/// # Errors
/// [`Error::UnknownBuiltin`] for another name.
pub fn builtin(name: &str, material: Option<&MaterialTable>) -> Result<Sheet, Error> {
    let file = format!("builtin:{name}");
    let parse = |text: &str| Scene::parse(text, file.as_ref());
    let of_curet = |id: &str| MaterialTable {
        curet: Some(id.to_owned()),
        ..MaterialTable::default()
    };
    let subject = |text: &str, default: &str| {
        let default = of_curet(default);
        text.replace("SUBJECT", &material.unwrap_or(&default).to_toml())
    };
    match name {
        "materials" => Ok(parse(&materials())?.into()),
        "mesh" => Ok(parse(&subject(MESH, "39"))?.into()),
        "contact-sheet" => {
            let panels = (0..12).map(|index| -> Result<Panel<MaterialTable>, Error> {
                let degrees = f64::from(index) * 15.0 - 82.5;
                let (sin, cos) = degrees.to_radians().sin_cos();
                let text =
                    subject(CONTACT, "15").replace("TOWARDS", &format!("[{sin}, 0.25, {cos}]"));
                Ok(Panel {
                    title: format!("light at {degrees:+} degrees"),
                    content: Content::Scene(Box::new(parse(&text)?)),
                })
            });
            Ok(Sheet {
                columns: 4,
                panels: panels.collect::<Result<_, _>>()?,
                caption: "{name}. {data}. The lamp moves around from left to right.".to_owned(),
            })
        }
        "comparison" => {
            let materials = match material {
                Some(material) => vec![material.clone()],
                None => COMPARED.map(|id| of_curet(&id.to_string())).to_vec(),
            };
            let mut panels = Vec::new();
            for material in materials {
                let first = panels.len();
                for (title, fit) in [
                    ("{name}: interpolated", "interpolation"),
                    ("ELM", "elm"),
                    ("GGX + Oren-Nayar", "ggx+oren-nayar"),
                ] {
                    let text = COMPARISON
                        .replace("SUBJECT", &material.to_toml())
                        .replace("FIT", fit);
                    panels.push(Panel {
                        title: title.to_owned(),
                        content: Content::Scene(Box::new(parse(&text)?)),
                    });
                }
                for (title, of) in [
                    ("4 |ELM - interpolated|", 1),
                    ("4 |GGX+ON - interpolated|", 2),
                ] {
                    panels.push(Panel {
                        title: title.to_owned(),
                        content: Content::Difference {
                            of: first + of,
                            from: first,
                            factor: 4.0,
                        },
                    });
                }
            }
            Ok(Sheet {
                columns: 5,
                panels,
                caption: "{data}. Differences of radiance, times 4.".to_owned(),
            })
        }
        _ => Err(Error::UnknownBuiltin {
            name: name.to_owned(),
            known: NAMES.join(", "),
        }),
    }
}

/// A sphere of each of the paper's materials, five in a row.
fn materials() -> String {
    let mut text = String::from(MATERIALS);
    for (index, printed) in published::TABLES.iter().enumerate() {
        let (row, column) = (index / 5, index % 5);
        let id = printed.id;
        let x = (column as f64 - 2.0) * 2.9;
        let y = (1.0 - row as f64) * 2.72 + 0.2;
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "[material.m{id:02}]\ncuret = '{id}'\n\
             [[sphere]]\ncenter = [{x}, {y}, 0]\nradius = 1.12\nmaterial = 'm{id:02}'\n\
             label = '{{name}}'\n"
        );
    }
    text
}

/// Both lamps stand so far in front that no sphere shades its neighbour.
const MATERIALS: &str = "
[image]
width = 1920
height = 1080
samples = 16
caption = \"The paper's 15 materials. {data}. A lamp over the left shoulder, a dim one at the right knee.\"

[camera]
position = [0, 0, 40]
target = [0, 0, 0]
fov = 12.2

[[directional]]
towards = [-0.6, 0.7, 1]
irradiance = [2.6, 2.6, 2.6]

[[directional]]
towards = [0.5, -1, 1.6]
irradiance = [0.45, 0.45, 0.45]
";

const CONTACT: &str = "
[image]
width = 360
height = 360
samples = 16

[camera]
position = [0, 0, 5]
target = [0, 0, 0]
height = 2.8

[material.subject]
SUBJECT

[[sphere]]
center = [0, 0, 0]
radius = 1
material = 'subject'

[[directional]]
towards = TOWARDS
irradiance = [2.5, 2.5, 2.5]
";

const COMPARISON: &str = "
[image]
width = 360
height = 360
samples = 16

[camera]
position = [0, 0, 5]
target = [0, 0, 0]
height = 2.8

[material.subject]
SUBJECT
fit = 'FIT'

[[sphere]]
center = [0, 0, 0]
radius = 1
material = 'subject'

[[directional]]
towards = [-0.6, 0.7, 1]
irradiance = [2.5, 2.5, 2.5]
";

const MESH: &str = "
[image]
width = 960
height = 720
samples = 64
caption = '{name}. {data}. A torus knot in a studio, direct light.'

[camera]
position = [0, 1.1, 6]
target = [0, 0, 0]
fov = 28

[environment]
builtin = 'studio'
rotation = -20

[material.subject]
SUBJECT

[material.floor]
analytic = 'oren-nayar'
albedo = 0.35
roughness = 0.4

[[mesh]]
builtin = 'torus-knot'
material = 'subject'
rotate = [-20, 25, 0]
translate = [0, 0.15, 0]

[[plane]]
point = [0, -1.25, 0]
normal = [0, 1, 0]
material = 'floor'
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_scene_is_well_formed() {
        let table = MaterialTable {
            curet: Some("it's \"quoted\"\n".to_owned()),
            ..MaterialTable::default()
        };
        for name in NAMES {
            for material in [None, Some(&table)] {
                let sheet = builtin(name, material).unwrap();
                assert_eq!(sheet.panels.len() % sheet.columns, 0, "{name}");
            }
        }
        assert!(builtin("teapot", None).is_err());
    }
}
