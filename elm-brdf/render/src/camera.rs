//! Maps points of the picture to rays, and back.

use crate::error::{Error, Result};
use crate::scene::{self, Scene};
use crate::shape::Ray;
use crate::vector::Vec3;

/// A pinhole or an orthographic camera.
#[derive(Debug, Clone)]
pub(crate) struct Camera {
    position: Vec3,
    /// Right, up and forward.
    axes: [Vec3; 3],
    projection: Projection,
    width: f64,
    height: f64,
}

#[derive(Debug, Clone, Copy)]
enum Projection {
    /// Half the height of the view at distance 1.
    Perspective(f64),
    /// Half the height of the view.
    Orthographic(f64),
}

impl Camera {
    pub(crate) fn new<M>(scene: &Scene<M>) -> Result<Self> {
        let scene::Camera {
            position,
            target,
            up,
            fov,
            height,
        } = &scene.camera;
        let wrong = |what, found: String, expected| Error::Value {
            place: scene.whole(),
            what,
            found,
            expected,
        };
        let eye = Vec3::from(*position);
        let forward = Vec3::from(*target) - eye;
        let distance = forward.norm();
        if !(distance > 0.0 && distance.is_finite()) {
            let found = format!("{target:?} seen from {position:?}");
            return Err(wrong("camera.target", found, "another finite point"));
        }
        let forward = forward / distance;
        let right = forward.cross(&Vec3::from(*up));
        // Relative to `up`, so that its length does not matter.
        if !(right.norm() > 1e-9 * Vec3::from(*up).norm() && right.norm().is_finite()) {
            let expected = "a direction across the view";
            return Err(wrong("camera.up", format!("{up:?}"), expected));
        }
        let right = right.normalize();
        let projection = match (fov, height) {
            (_, Some(height)) if !(*height > 0.0 && height.is_finite()) => {
                return Err(wrong("camera.height", height.to_string(), "more than 0"));
            }
            (None, Some(height)) => Projection::Orthographic(height / 2.0),
            (Some(fov), None) if *fov > 0.0 && *fov < 180.0 => {
                Projection::Perspective((fov.to_radians() / 2.0).tan())
            }
            (Some(fov), None) => {
                return Err(wrong(
                    "camera.fov",
                    fov.to_string(),
                    "degrees between 0 and 180",
                ));
            }
            _ => {
                let found = "with both or neither of fov and height".to_owned();
                return Err(wrong("camera", found, "one of them"));
            }
        };
        Ok(Self {
            position: eye,
            axes: [right, right.cross(&forward), forward],
            projection,
            width: f64::from(scene.image.width),
            height: f64::from(scene.image.height),
        })
    }

    /// The ray through a point of the picture, in pixels from its upper left corner.
    pub(crate) fn ray(&self, x: f64, y: f64) -> Ray {
        let [right, up, forward] = self.axes;
        // In half heights from the middle; pixels are square.
        let across = (2.0 * x - self.width) / self.height;
        let above = 1.0 - 2.0 * y / self.height;
        match self.projection {
            Projection::Perspective(half) => Ray {
                origin: self.position,
                direction: (forward + (right * across + up * above) * half).normalize(),
            },
            Projection::Orthographic(half) => Ray {
                origin: self.position + (right * across + up * above) * half,
                direction: forward,
            },
        }
    }

    /// Where in the picture a point lies, in pixels; `None` if behind the camera.
    pub(crate) fn project(&self, point: Vec3) -> Option<[f64; 2]> {
        let [x, y, depth] = self.axes.map(|axis| axis.dot(&(point - self.position)));
        let half = match self.projection {
            Projection::Perspective(half) => half * depth,
            Projection::Orthographic(half) => half,
        };
        (depth > 0.0).then(|| {
            let pixels = self.height / 2.0;
            [
                self.width / 2.0 + x / half * pixels,
                pixels - y / half * pixels,
            ]
        })
    }

    /// The direction that is up in the picture.
    pub(crate) fn up(&self) -> Vec3 {
        self.axes[1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(lens: &str) -> Result<Camera> {
        let text = format!(
            "[image]\nwidth = 40\nheight = 20\n[camera]\nposition = [1, 2, 5]\ntarget = [1, 2, 0]\n{lens}"
        );
        Camera::new(&Scene::<toml::Table>::parse(&text, "t".as_ref())?)
    }

    #[test]
    fn rays_go_where_points_project_from() {
        for lens in ["fov = 50", "height = 3"] {
            let camera = camera(lens).unwrap();
            for (x, y) in [(0.0, 0.0), (40.0, 20.0), (7.5, 13.25)] {
                let ray = camera.ray(x, y);
                let [u, v] = camera.project(ray.origin + ray.direction * 3.0).unwrap();
                assert!((u - x).abs() < 1e-9 && (v - y).abs() < 1e-9, "{lens}");
            }
        }
    }

    #[test]
    fn the_top_of_the_picture_is_half_the_angle_of_view_up() {
        let direction = camera("fov = 90").unwrap().ray(20.0, 0.0).direction;
        let expected = Vec3::new(0.0, 1.0, -1.0).normalize();
        assert!((direction - expected).norm() < 1e-15);
    }

    #[test]
    fn impossible_lenses_are_refused() {
        for lens in [
            "",
            "fov = 0",
            "fov = 180",
            "fov = nan",
            "height = -1",
            "fov = 5\nheight = 1",
            "fov = 30\nup = [0, 0, 1]",
            "fov = 30\nup = [0, 0, 0]",
            "fov = 30\nup = [nan, 1, 0]",
        ] {
            assert!(camera(lens).is_err(), "{lens}");
        }
    }
}
