//! Scenes that need no file.

use std::fmt::Write;

use super::error::SceneError;
use super::scene::Scene;
use crate::published;

/// Names of the built-in scenes.
const NAMES: [&str; 2] = ["materials", "mesh"];

/// A built-in scene: `materials`, a sphere of each of the paper's 15 materials, or `mesh`, a torus
/// knot in a studio.
///
/// # Errors
/// [`SceneError::UnknownBuiltin`] for another name.
pub fn builtin(name: &str) -> Result<Scene, SceneError> {
    let text = match name {
        "materials" => materials(),
        "mesh" => MESH.to_owned(),
        _ => {
            return Err(SceneError::UnknownBuiltin {
                name: name.to_owned(),
                known: NAMES.join(", "),
            });
        }
    };
    Scene::parse(&text, format!("builtin:{name}").as_ref())
}

/// A sphere of each of the paper's materials, five in a row.
fn materials() -> String {
    let mut text = String::from(MATERIALS);
    for (index, printed) in published::TABLES.iter().enumerate() {
        let (row, column) = (index / 5, index % 5);
        let id = printed.id;
        let x = (column as f64 - 2.0) * 2.9;
        let y = (1.0 - row as f64) * 2.75 + 0.14;
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "[material.m{id:02}]\ncuret = '{id}'\n\
             [[sphere]]\ncentre = [{x}, {y}, 0]\nradius = 1.13\nmaterial = 'm{id:02}'\n\
             label = '{id} {}'\n",
            printed.name
        );
    }
    text
}

const MATERIALS: &str = "
[image]
width = 1920
height = 1080
samples = 16
caption = \"The paper's 15 materials: {data}. One lamp over the left shoulder and a dim one at the right.\"

[camera]
position = [0, 0, 40]
target = [0, 0, 0]
fov = 12.2

[[directional]]
towards = [-0.55, 0.6, 1]
irradiance = [2.6, 2.6, 2.6]

[[directional]]
towards = [1, 0.1, 0.15]
irradiance = [0.7, 0.7, 0.7]
";

const MESH: &str = "
[image]
width = 960
height = 720
samples = 64
caption = 'Human Skin: {data}. A torus knot in a studio, direct light.'

[camera]
position = [0, 1.1, 6]
target = [0, -0.1, 0]
fov = 26

[environment]
builtin = 'studio'
visible = false

[material.knot]
curet = '39'

[material.floor]
analytic = 'oren-nayar'
albedo = 0.35
roughness = 0.4

[[mesh]]
builtin = 'torus-knot'
material = 'knot'
rotate = [-20, 25, 0]
translate = [0, 0.15, 0]

[[plane]]
point = [0, -1.25, 0]
normal = [0, 1, 0]
material = 'floor'
";
