//! Compiles a scene for rendering: checks it, reads its files, and puts its shapes into a
//! hierarchy.

use crate::bvh::Hierarchy;
use crate::camera::Camera;
use crate::environment::{Environment, EnvironmentMap};
use crate::error::{Error, Place, Result};
use crate::light::{Area, Light};
use crate::mesh;
use crate::scene::{Scene, Triple};
use crate::shape::{Primitive, Ray, SurfacePoint};
use crate::vector::{BLACK, Rgb, Vec3};

/// Largest picture, in pixels: 8K fits, and takes some three gigabytes while it is made.
const MAX_PIXELS: u64 = 1 << 25;
/// Most lights; each is looked at from each visible point.
const MAX_LIGHTS: u64 = 1 << 16;
/// Most surfaces that light may meet on its way.
const MAX_DEPTH: u64 = 64;

/// What rays travel through.
pub(crate) struct CompiledScene {
    pub(crate) camera: Camera,
    pub(crate) lights: Vec<Light>,
    /// Names of the materials, in the order of their indices.
    pub(crate) materials: Vec<String>,
    /// Whether directions drawn from a material can find a light.
    pub(crate) has_extended_lights: bool,
    /// Whether some of these are forms that a ray can meet.
    pub(crate) has_area_lights: bool,
    hierarchy: Hierarchy,
    /// What each form belongs to.
    surfaces: Vec<Surface>,
    environment: Option<usize>,
}

#[derive(Debug, Clone, Copy)]
struct Surface {
    /// Number of the shape in the scene.
    object: u32,
    role: Role,
}

#[derive(Debug, Clone, Copy)]
enum Role {
    /// Reflects, by the index of its material.
    Reflector(usize),
    /// Shines, by the index of its light.
    Emitter(usize),
}

/// What a ray met.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Hit {
    Reflector {
        point: SurfacePoint,
        material: usize,
        /// Number of the shape in the scene.
        object: u32,
    },
    /// A light, with the radiance that it sends back along the ray.
    Emitter {
        radiance: Rgb,
        light: usize,
        distance: f64,
    },
    Nothing,
}

impl CompiledScene {
    pub(crate) fn new<M>(scene: &Scene<M>) -> Result<Self> {
        check_image(scene)?;
        let mut builder = Builder {
            scene,
            materials: scene.material.keys().cloned().collect(),
            primitives: Vec::new(),
            surfaces: Vec::new(),
            lights: Vec::new(),
            objects: 0,
        };
        builder.lights()?;
        builder.shapes()?;
        let environment = builder
            .lights
            .iter()
            .position(|l| matches!(l, Light::Environment(_)));
        Ok(Self {
            camera: Camera::new(scene)?,
            has_area_lights: builder.lights.iter().any(|l| matches!(l, Light::Area(_))),
            has_extended_lights: builder.lights.iter().any(Light::has_extent),
            lights: builder.lights,
            materials: builder.materials,
            hierarchy: Hierarchy::new(builder.primitives),
            surfaces: builder.surfaces,
            environment,
        })
    }

    /// What a ray meets first.
    pub(crate) fn intersect(&self, ray: &Ray) -> Hit {
        let Some((form, meeting)) = self.hierarchy.nearest(ray, self.nudge(ray), f64::INFINITY)
        else {
            return Hit::Nothing;
        };
        let Surface { object, role } = self.surfaces[form];
        match role {
            Role::Reflector(material) => Hit::Reflector {
                point: self.hierarchy.form(form).surface(ray, meeting),
                material,
                object,
            },
            Role::Emitter(light) => Hit::Emitter {
                radiance: match &self.lights[light] {
                    Light::Area(area) => area.radiance(ray.direction),
                    _ => BLACK,
                },
                light,
                distance: meeting.distance,
            },
        }
    }

    /// Whether something stands in the way for `distance`.
    pub(crate) fn blocked(&self, ray: &Ray, distance: f64) -> bool {
        let near = self.nudge(ray);
        // A little short of the light, which is a form of its own.
        self.hierarchy
            .blocked(ray, near, distance * (1.0 - 1e-9) - near)
    }

    /// How far a ray travels before it can meet anything, so that it does not meet where it began:
    /// far above rounding errors, far below anything seen.
    fn nudge(&self, ray: &Ray) -> f64 {
        1e-9 * (self.hierarchy.diameter() + ray.origin.amax())
    }

    /// The light around everything, with its index.
    pub(crate) fn environment(&self) -> Option<(usize, &Environment)> {
        let index = self.environment?;
        match &self.lights[index] {
            Light::Environment(environment) => Some((index, environment)),
            _ => None,
        }
    }
}

fn check_image<M>(scene: &Scene<M>) -> Result<()> {
    let image = &scene.image;
    let place = scene.whole();
    if image.width == 0 || image.height == 0 {
        return Err(Error::Value {
            place,
            what: "the image size",
            found: format!("{} x {}", image.width, image.height),
            expected: "at least 1 x 1",
        });
    }
    let too_many = |what, found: u64, limit: u64| {
        if found > limit {
            let place = scene.whole();
            return Err(Error::TooMany {
                place,
                what,
                found,
                limit,
            });
        }
        Ok(())
    };
    too_many(
        "pixels",
        u64::from(image.width) * u64::from(image.height),
        MAX_PIXELS,
    )?;
    too_many(
        "samples per pixel",
        image.samples.into(),
        Scene::<M>::MAX_SAMPLES.into(),
    )?;
    too_many("surfaces on a path (depth)", image.depth.into(), MAX_DEPTH)?;
    let lights = scene.directional.len() + scene.point.len() + scene.area.len();
    too_many("lights", lights as u64, MAX_LIGHTS)?;
    for (what, found, wrong) in [
        (
            "image.samples",
            image.samples.to_string(),
            image.samples == 0,
        ),
        ("image.depth", image.depth.to_string(), image.depth == 0),
        (
            "image.exposure",
            image.exposure.to_string(),
            image.exposure.is_nan() || image.exposure.abs() > 100.0,
        ),
    ] {
        if wrong {
            let expected = if what == "image.exposure" {
                "-100 to 100 stops"
            } else {
                "at least 1"
            };
            return Err(Error::Value {
                place,
                what,
                found,
                expected,
            });
        }
    }
    Ok(())
}

/// A scene on its way to a [`CompiledScene`].
struct Builder<'a, M> {
    scene: &'a Scene<M>,
    materials: Vec<String>,
    primitives: Vec<Primitive>,
    surfaces: Vec<Surface>,
    lights: Vec<Light>,
    objects: u32,
}

impl<M> Builder<'_, M> {
    fn lights(&mut self) -> Result<()> {
        let scene = self.scene;
        for entry in &scene.directional {
            let place = scene.place(entry);
            let light = entry.get_ref();
            self.lights.push(Light::Directional {
                towards: direction(&place, "towards", light.towards)?,
                irradiance: color(&place, "irradiance", light.irradiance)?,
            });
        }
        for entry in &scene.point {
            let place = scene.place(entry);
            let light = entry.get_ref();
            self.lights.push(Light::Point {
                position: finite(&place, "position", light.position)?,
                intensity: color(&place, "intensity", light.intensity)?,
            });
        }
        for entry in &scene.area {
            let place = scene.place(entry);
            let light = entry.get_ref();
            let area = Area {
                corner: finite(&place, "corner", light.corner)?,
                edges: edges(&place, light.edge_u, light.edge_v)?,
                radiance: color(&place, "radiance", light.radiance)?,
            };
            let role = Role::Emitter(self.lights.len());
            self.push([area.form()], role);
            self.lights.push(Light::Area(area));
        }
        if let Some(entry) = &scene.environment {
            let place = scene.place(entry);
            let light = entry.get_ref();
            let wrong = |found: String, expected| Error::Value {
                place: place.clone(),
                what: "environment",
                found,
                expected,
            };
            if !light.rotation.is_finite() {
                return Err(wrong(format!("turned by {}", light.rotation), "degrees"));
            }
            let panorama = match (&light.file, light.builtin.as_deref()) {
                (Some(_), Some(_)) => {
                    let found = "with both file and builtin".to_owned();
                    return Err(wrong(found, "one of them, or neither"));
                }
                (Some(file), None) => {
                    Some(EnvironmentMap::read(&scene.beside(file), light.rotation)?)
                }
                (None, Some("studio")) => Some(EnvironmentMap::studio(light.rotation)),
                (None, Some(name)) => return Err(wrong(format!("'{name}'"), "'studio'")),
                (None, None) => None,
            };
            self.lights.push(Light::Environment(Environment {
                radiance: color(&place, "radiance", light.radiance)?,
                panorama,
                visible: light.visible,
            }));
        }
        Ok(())
    }

    fn shapes(&mut self) -> Result<()> {
        let scene = self.scene;
        for entry in &scene.sphere {
            let place = scene.place(entry);
            let sphere = entry.get_ref();
            let role = self.reflector(&sphere.material)?;
            let radius = positive(&place, "radius", sphere.radius)?;
            let center = finite(&place, "center", sphere.center)?;
            self.push([Primitive::Sphere { center, radius }], role);
        }
        for entry in &scene.plane {
            let place = scene.place(entry);
            let plane = entry.get_ref();
            let role = self.reflector(&plane.material)?;
            let point = finite(&place, "point", plane.point)?;
            let normal = direction(&place, "normal", plane.normal)?;
            self.push([Primitive::Plane { point, normal }], role);
        }
        for entry in &scene.rectangle {
            let place = scene.place(entry);
            let rectangle = entry.get_ref();
            let role = self.reflector(&rectangle.material)?;
            let corner = finite(&place, "corner", rectangle.corner)?;
            let [u, v] = edges(&place, rectangle.edge_u, rectangle.edge_v)?;
            self.push([Primitive::Parallelogram { corner, u, v }], role);
        }
        for entry in &scene.mesh {
            let place = scene.place(entry);
            let shape = entry.get_ref();
            let role = self.reflector(&shape.material)?;
            let wrong = |found: String, expected| Error::Value {
                place: place.clone(),
                what: "mesh",
                found,
                expected,
            };
            let triangles = match (&shape.file, shape.builtin.as_deref()) {
                (Some(file), None) => mesh::read(&scene.beside(file))?,
                (None, Some("torus-knot")) => mesh::torus_knot(600, 60),
                (None, Some(name)) => return Err(wrong(format!("'{name}'"), "'torus-knot'")),
                _ => {
                    let found = "with both or neither of file and builtin".to_owned();
                    return Err(wrong(found, "one of them"));
                }
            };
            let scale = positive(&place, "scale", shape.scale)?;
            finite(&place, "rotate", shape.rotate)?;
            finite(&place, "translate", shape.translate)?;
            let placed = mesh::placed(triangles, scale, shape.rotate, shape.translate);
            self.push(
                placed.into_iter().map(|t| Primitive::Triangle(Box::new(t))),
                role,
            );
        }
        Ok(())
    }

    /// The role of a shape with this material.
    fn reflector(&self, name: &toml::Spanned<String>) -> Result<Role> {
        match self.materials.binary_search(name.get_ref()) {
            Ok(index) => Ok(Role::Reflector(index)),
            Err(_) => Err(Error::UnknownMaterial {
                place: self.scene.place(name),
                name: name.get_ref().clone(),
                known: self.materials.join(", "),
            }),
        }
    }

    fn push(&mut self, primitives: impl IntoIterator<Item = Primitive>, role: Role) {
        let surface = Surface {
            object: self.objects,
            role,
        };
        self.primitives.extend(primitives);
        self.surfaces.resize(self.primitives.len(), surface);
        self.objects += 1;
    }
}

fn wrong(place: &Place, what: &'static str, found: impl ToString, expected: &'static str) -> Error {
    Error::Value {
        place: place.clone(),
        what,
        found: found.to_string(),
        expected,
    }
}

/// Coordinates beyond this would overflow when squared a few times over.
const MAX_DISTANCE: f64 = 1e30;

fn finite(place: &Place, what: &'static str, value: Triple) -> Result<Vec3> {
    if value.iter().all(|c| c.abs() <= MAX_DISTANCE) {
        Ok(value.into())
    } else {
        Err(wrong(
            place,
            what,
            format!("{value:?}"),
            "three finite numbers",
        ))
    }
}

fn direction(place: &Place, what: &'static str, value: Triple) -> Result<Vec3> {
    finite(place, what, value)?
        .try_normalize(1e-30)
        .ok_or_else(|| wrong(place, what, format!("{value:?}"), "a direction"))
}

fn color(place: &Place, what: &'static str, value: Triple) -> Result<Rgb> {
    if value.iter().all(|c| (0.0..=MAX_DISTANCE).contains(c)) {
        Ok(value)
    } else {
        let expected = "three finite numbers, none negative";
        Err(wrong(place, what, format!("{value:?}"), expected))
    }
}

fn positive(place: &Place, what: &'static str, value: f64) -> Result<f64> {
    if value > 0.0 && value <= MAX_DISTANCE {
        Ok(value)
    } else {
        Err(wrong(place, what, value, "a finite number above 0"))
    }
}

fn edges(place: &Place, u: Triple, v: Triple) -> Result<[Vec3; 2]> {
    let edges = [finite(place, "edge_u", u)?, finite(place, "edge_v", v)?];
    if edges[0].cross(&edges[1]).norm() > 1e-30 {
        Ok(edges)
    } else {
        let found = format!("{u:?} x {v:?}");
        Err(wrong(
            place,
            "edge_u x edge_v",
            found,
            "two edges with an area",
        ))
    }
}
