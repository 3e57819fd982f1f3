//! RGL files made from formulas, written without the crate's help.

use std::f64::consts::PI;

/// A field: its name, type, shape and bytes.
#[derive(Clone)]
pub(crate) struct Field {
    pub(crate) name: &'static str,
    pub(crate) code: u8,
    pub(crate) shape: Vec<u64>,
    pub(crate) bytes: Vec<u8>,
}

pub(crate) fn floats(name: &'static str, shape: &[u64], numbers: &[f64]) -> Field {
    assert_eq!(
        shape.iter().product::<u64>(),
        numbers.len() as u64,
        "{name}"
    );
    Field {
        name,
        code: 10,
        shape: shape.to_vec(),
        bytes: numbers
            .iter()
            .flat_map(|&number| (number as f32).to_le_bytes())
            .collect(),
    }
}

pub(crate) fn bytes(name: &'static str, bytes: &[u8]) -> Field {
    Field {
        name,
        code: 1,
        shape: vec![bytes.len() as u64],
        bytes: bytes.to_vec(),
    }
}

/// The container: the descriptions of all fields, then their numbers.
pub(crate) fn file(fields: &[Field]) -> Vec<u8> {
    let description = |field: &Field| 2 + field.name.len() + 2 + 1 + 8 + 8 * field.shape.len();
    let mut offset = 18 + fields.iter().map(description).sum::<usize>();
    let mut out = b"tensor_file\0\x01\x00".to_vec();
    out.extend((fields.len() as u32).to_le_bytes());
    for field in fields {
        out.extend((field.name.len() as u16).to_le_bytes());
        out.extend(field.name.as_bytes());
        out.extend((field.shape.len() as u16).to_le_bytes());
        out.push(field.code);
        out.extend((offset as u64).to_le_bytes());
        out.extend(field.shape.iter().flat_map(|size| size.to_le_bytes()));
        offset += field.bytes.len();
    }
    for field in fields {
        out.extend(&field.bytes);
    }
    out
}

/// A table of a function over the unit square, the first coordinate along rows.
pub(crate) fn tabulate(width: usize, height: usize, f: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let share = |k: usize, n: usize| k as f64 / (n - 1) as f64;
    (0..width * height)
        .map(|k| f(share(k % width, width), share(k / width, height)))
        .collect()
}

/// A surface of microfacets after Walter et al. 2007 and Heitz 2014 (GGX, Smith's masking
/// correlated by height) with a constant reflectance of the facets.
pub(crate) struct Ggx {
    pub(crate) alpha: f64,
    pub(crate) facet: [f64; 3],
}

impl Ggx {
    /// D, per unit of solid angle of the normals.
    fn distribution(&self, theta: f64) -> f64 {
        let (a2, c2) = (self.alpha * self.alpha, theta.cos().powi(2));
        a2 / (PI * (1.0 - c2 + a2 * c2).powi(2))
    }

    fn g(&self, cos: f64) -> f64 {
        let a2 = self.alpha * self.alpha;
        (a2 + (1.0 - a2) * cos * cos).sqrt()
    }

    /// Projected area of the facets seen from an angle: cos / G1.
    fn sigma(&self, theta: f64) -> f64 {
        f64::midpoint(theta.cos(), self.g(theta.cos()))
    }

    /// BRDF per unit of the facets' reflectance.
    pub(crate) fn brdf(&self, cos_i: f64, cos_o: f64, theta_m: f64) -> f64 {
        let shadow = 0.5 / (cos_o * self.g(cos_i) + cos_i * self.g(cos_o));
        self.distribution(theta_m) * shadow
    }

    /// What is left of the BRDF times cos_o without 4 sigma / D. Where the mirrored direction is
    /// below the horizon the formula goes on smoothly enough with a grazing one.
    fn rest(&self, theta_i: f64, theta_m: f64, phi_m: f64) -> f64 {
        let cos_d = theta_i.cos() * theta_m.cos() + theta_i.sin() * theta_m.sin() * phi_m.cos();
        let cos_o = (2.0 * cos_d * theta_m.cos() - theta_i.cos()).max(0.01);
        let cos_i = theta_i.cos();
        let shadow = 0.5 / (cos_o * self.g(cos_i) + cos_i * self.g(cos_o));
        4.0 * self.sigma(theta_i) * shadow * cos_o
    }

    /// A file with these elevations, `fine` points a side in the tables of the shape, and
    /// `coarse` in those of the values.
    pub(crate) fn file(&self, elevations: &[f64], fine: usize, coarse: usize) -> Vec<u8> {
        let theta = |u: f64| u * u * PI / 2.0;
        let phi = |v: f64| (2.0 * v - 1.0) * PI;
        let (mut vndf, mut rgb) = (Vec::new(), Vec::new());
        for &theta_i in elevations {
            // Solid angle of the unit square: sin(theta) dtheta dphi = sin (pi u du) (2 pi dv).
            let seen = tabulate(fine, fine, |u, v| {
                let (theta_m, phi_m) = (theta(u), phi(v));
                let cos =
                    theta_i.cos() * theta_m.cos() + theta_i.sin() * theta_m.sin() * phi_m.cos();
                let density = self.distribution(theta_m) * cos.max(0.0) / self.sigma(theta_i);
                density * 2.0 * PI * PI * u * theta_m.sin()
            });
            let seen: Vec<f64> = seen.iter().map(|&x| f64::from(x as f32)).collect();
            let rest = tabulate(coarse, coarse, |x, y| {
                let [u, v] = unflatten(&seen, fine, [x, y]);
                self.rest(theta_i, theta(u), phi(v))
            });
            for facet in self.facet {
                rgb.extend(rest.iter().map(|value| facet * value));
            }
            vndf.extend(seen);
        }
        let (f, c, n) = (fine as u64, coarse as u64, elevations.len() as u64);
        let ndf = tabulate(fine, fine, |u, _| self.distribution(theta(u)));
        let sigma = tabulate(fine, fine, |u, _| self.sigma(theta(u)));
        file(&[
            bytes("description", b"made from GGX"),
            floats("phi_i", &[1], &[0.0]),
            floats("theta_i", &[n], elevations),
            floats("ndf", &[f, f], &ndf),
            floats("sigma", &[f, f], &sigma),
            floats("vndf", &[1, n, f, f], &vndf),
            floats("rgb", &[1, n, 3, c, c], &rgb),
            bytes("jacobian", &[1]),
        ])
    }
}

/// The same with a grain along x: Heitz 2014, *Understanding the Masking-Shadowing Function in
/// Microfacet-Based BRDFs*, JCGT 3(2), equations 85 and 86.
pub(crate) struct Brushed {
    pub(crate) alpha: [f64; 2],
    pub(crate) facet: [f64; 3],
}

impl Brushed {
    fn distribution(&self, [x, y, z]: [f64; 3]) -> f64 {
        let [a, b] = self.alpha;
        1.0 / (PI * a * b * ((x / a).powi(2) + (y / b).powi(2) + z * z).powi(2))
    }

    fn g(&self, [x, y, z]: [f64; 3]) -> f64 {
        let [a, b] = self.alpha;
        ((a * x).powi(2) + (b * y).powi(2) + z * z).sqrt()
    }

    fn sigma(&self, direction: [f64; 3]) -> f64 {
        f64::midpoint(direction[2], self.g(direction))
    }

    /// BRDF per unit of the facets' reflectance; `m` is the half vector.
    pub(crate) fn brdf(&self, i: [f64; 3], o: [f64; 3], m: [f64; 3]) -> f64 {
        self.distribution(m) * 0.5 / (o[2] * self.g(i) + i[2] * self.g(o))
    }

    /// As [`Ggx::rest`].
    fn rest(&self, i: [f64; 3], m: [f64; 3]) -> f64 {
        let cos = i[0] * m[0] + i[1] * m[1] + i[2] * m[2];
        let mut o = [0, 1, 2].map(|k| 2.0 * cos * m[k] - i[k]);
        o[2] = o[2].max(0.01);
        4.0 * self.sigma(i) * 0.5 / (o[2] * self.g(i) + i[2] * self.g(o)) * o[2]
    }

    /// As [`Ggx::file`], for light from these azimuths.
    pub(crate) fn file(
        &self,
        azimuths: &[f64],
        elevations: &[f64],
        fine: usize,
        coarse: usize,
    ) -> Vec<u8> {
        let unit = |theta: f64, phi: f64| {
            [
                theta.sin() * phi.cos(),
                theta.sin() * phi.sin(),
                theta.cos(),
            ]
        };
        let theta = |u: f64| u * u * PI / 2.0;
        let at = |u: f64, v: f64| unit(theta(u), (2.0 * v - 1.0) * PI);
        let (mut vndf, mut rgb) = (Vec::new(), Vec::new());
        for &phi_i in azimuths {
            for &theta_i in elevations {
                let i = unit(theta_i, phi_i);
                let seen = tabulate(fine, fine, |u, v| {
                    let m = at(u, v);
                    let cos = i[0] * m[0] + i[1] * m[1] + i[2] * m[2];
                    let density = self.distribution(m) * cos.max(0.0) / self.sigma(i);
                    density * 2.0 * PI * PI * u * theta(u).sin()
                });
                let seen: Vec<f64> = seen.iter().map(|&x| f64::from(x as f32)).collect();
                let rest = tabulate(coarse, coarse, |x, y| {
                    let [u, v] = unflatten(&seen, fine, [x, y]);
                    self.rest(i, at(u, v))
                });
                for facet in self.facet {
                    rgb.extend(rest.iter().map(|value| facet * value));
                }
                vndf.extend(seen);
            }
        }
        let [f, c, n, k] = [fine, coarse, elevations.len(), azimuths.len()].map(|n| n as u64);
        let ndf = tabulate(fine, fine, |u, v| self.distribution(at(u, v)));
        let sigma = tabulate(fine, fine, |u, v| self.sigma(at(u, v)));
        file(&[
            bytes("description", b"made from GGX with a grain"),
            floats("phi_i", &[k], azimuths),
            floats("theta_i", &[n], elevations),
            floats("ndf", &[f, f], &ndf),
            floats("sigma", &[f, f], &sigma),
            floats("vndf", &[k, n, f, f], &vndf),
            floats("rgb", &[k, n, 3, c, c], &rgb),
            bytes("jacobian", &[1]),
        ])
    }
}

/// The inverse of the map that flattens a table of n x n: by bisection of integrals that the
/// trapezoidal rule has exactly, for the density is linear along every step.
fn unflatten(table: &[f64], n: usize, [x, y]: [f64; 2]) -> [f64; 2] {
    let totals: Vec<f64> = table.chunks(n).map(|row| integral(row, 1.0)).collect();
    let v = bisect(|v| integral(&totals, v), y * integral(&totals, 1.0));
    let row: Vec<f64> = (0..n)
        .map(|column| {
            let across: Vec<f64> = table.iter().skip(column).step_by(n).copied().collect();
            linear(&across, v)
        })
        .collect();
    let u = bisect(|u| integral(&row, u), x * integral(&row, 1.0));
    [u, v]
}

fn linear(values: &[f64], x: f64) -> f64 {
    let along = x * (values.len() - 1) as f64;
    let step = (along as usize).min(values.len() - 2);
    let share = along - step as f64;
    values[step] * (1.0 - share) + values[step + 1] * share
}

/// Integral from 0 to x of the interpolant of values at equal steps from 0 to 1.
fn integral(values: &[f64], x: f64) -> f64 {
    let steps = (values.len() - 1) as f64;
    let last = ((x * steps) as usize).min(values.len() - 2);
    let mut sum: f64 = (0..last).map(|k| (values[k] + values[k + 1]) / 2.0).sum();
    sum += (x * steps - last as f64) * f64::midpoint(values[last], linear(values, x));
    sum / steps
}

fn bisect(f: impl Fn(f64) -> f64, value: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..40 {
        let middle = f64::midpoint(low, high);
        if f(middle) < value {
            low = middle;
        } else {
            high = middle;
        }
    }
    f64::midpoint(low, high)
}
