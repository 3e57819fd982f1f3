//! Measured reflectance: CUReT, scattered samples, MERL, RGL, pbrt.

use std::f64::consts::FRAC_PI_2;
use std::fmt::Write as _;

use elm_datasets::merl::Merl;
use elm_datasets::rgl::{Channels, Rgl};
use elm_datasets::scattered::{self, AngleUnit, Options};
use elm_datasets::{Angles, DirectionPair, Samples, curet, pbrt};

use super::{Reader, Seed, read};

pub(super) const CURET_TABLE: Reader = Reader {
    name: "curet_table",
    seeds: || {
        vec![
            seed("rig.txt", &table_text(&curet::rig::directions())),
            seed("bad-short.txt", "1 0.1 0.2 0.3 0.4\r\n2 0.1 0.2 0.3\r\n"),
            seed("bad-angle.txt", "1 1.6 0.2 0.3 0.4\n"),
        ]
    },
    read: |bytes| {
        let Some(directions) = read(bytes, || curet::parse_table(bytes, "table.txt")) else {
            return false;
        };
        assert_eq!(directions.len(), curet::MEASUREMENTS);
        assert!(directions.iter().all(DirectionPair::is_above_horizon));
        let again = curet::parse_table(table_text(&directions).as_bytes(), "again.txt");
        same_directions(&again.expect("what was written can be read"), &directions);
        true
    },
};

pub(super) const CURET_VALUES: Reader = Reader {
    name: "curet_values",
    seeds: || {
        let digit = |material: usize, measurement: usize| (material * measurement % 10) as f64;
        vec![
            seed("digits.dat", &values_text(digit)),
            seed("bad-short.dat", "1 0.1 0.2\n2 0.1\n"),
            seed("bad-number.dat", "62 0.1\n"),
        ]
    },
    read: |bytes| {
        let Some(values) = read(bytes, || curet::parse_values(bytes, "abrdf.dat")) else {
            return false;
        };
        assert_eq!(values.dim(), (curet::MATERIALS, curet::MEASUREMENTS));
        assert!(values.iter().all(|value| value.is_finite()));
        let text = values_text(|material, measurement| values[[material, measurement]]);
        let again = curet::parse_values(text.as_bytes(), "again.dat");
        assert_eq!(again.expect("what was written can be read"), values);
        true
    },
};

pub(super) const SCATTERED: Reader = Reader {
    name: "scattered",
    seeds: || {
        vec![
            seed(
                "angles.csv",
                "theta_i,phi_i,theta_o,phi_o,r,g\n0.1,0.2,0.3,0.4,1,2\r\n0.5,-3,1.2,4,3,4e-2\r\n",
            ),
            seed(
                "vectors.csv",
                "g,WI_x,wi_y,wi_z,wo_x,wo_y,wo_z\n1,0,0,1,0.6,0,0.8\n2,0.8,0,0.6,0,0,1\n",
            ),
            seed(
                "bad-horizon.csv",
                "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,y\n0,0,-1,0,0,1,2\n",
            ),
            seed("bad-columns.csv", "theta_i,phi_i,phi_o,y\n0.1,0.2,0.3,1\n"),
            seed(
                "semicolons.csv",
                "# angles in deg\n\nthi;phi_in;Theta_s;phi_s;\"a;b\"\n0,1;0;2e-1;1;0,5\n# more\n0;0;0;0;1\n",
            ),
            seed(
                "tabs.tsv",
                "SZA\tVZA\tRAA (rad)\tBRF 550 nm\tBRF 650 nm\n0.1\t0.2\t3\t0.4\t0.5\n",
            ),
            seed(
                "blanks.txt",
                "made by hand\n% theta_i  theta_o dphi reflectance_factor\n 0.1 0.2   3  0.5 \n",
            ),
        ]
    },
    read: |bytes| {
        let units = [AngleUnit::Radians, AngleUnit::Degrees];
        let mut whole = false;
        for (unit, cosine_weighted) in units.into_iter().flat_map(|u| [(u, false), (u, true)]) {
            let options = Options {
                unit,
                cosine_weighted,
            };
            let parse = || scattered::from_reader(bytes, "some.csv", &options);
            let Some(samples) = read(bytes, parse) else {
                continue;
            };
            sound(&samples);
            // Division by a cosine may leave the range; such samples are not written.
            let mut text = Vec::new();
            if samples.values.iter().all(|value| value.is_finite()) {
                scattered::to_writer(&mut text, "again.csv", &samples)
                    .expect("what was read can be written");
                let again = scattered::from_reader(&*text, "again.csv", &Options::default());
                same(&again.expect("what was written can be read"), &samples);
            }
            whole = true;
        }
        whole
    },
};

pub(super) const MERL: Reader = Reader {
    name: "merl",
    seeds: || {
        let mut header = Vec::new();
        for size in [90_i32, 90, 180] {
            header.extend(size.to_le_bytes());
        }
        let short = [&header[..], &[0; 64]].concat();
        vec![
            Seed {
                name: "bad-header.binary",
                bytes: header,
            },
            Seed {
                name: "bad-short.binary",
                bytes: short,
            },
        ]
    },
    // Whole tables hold 35 MB, too many to be guessed; elm-datasets' own tests have them.
    read: |bytes| read(bytes, || Merl::from_reader(bytes, "some.binary")).is_some(),
};

pub(super) const RGL: Reader = Reader {
    name: "rgl",
    seeds: || {
        vec![
            Seed {
                name: "rgb.bsdf",
                bytes: rgl_file(true),
            },
            Seed {
                name: "spectrum.bsdf",
                bytes: rgl_file(false),
            },
            Seed {
                name: "bad-empty.bsdf",
                bytes: b"tensor_file\0\x01\0\0\0\0\0".to_vec(),
            },
        ]
    },
    read: |bytes| {
        let Some(material) = read(bytes, || Rgl::from_bytes(bytes)) else {
            return false;
        };
        for (theta_i, phi_o) in [(0.0, 0.0), (0.3, 3.0), (1.2, -1.0), (FRAC_PI_2, 2.0)] {
            let pair = DirectionPair::from(Angles {
                theta_i,
                phi_i: 0.1,
                theta_o: 0.4,
                phi_o,
            });
            let values = material.at(&pair);
            assert_eq!(values.len(), material.channels().count());
            assert!(values.iter().all(|value| value.is_finite()), "{values:?}");
            if *material.channels() == Channels::Rgb {
                assert!(
                    values.iter().all(|value| *value >= 0.0),
                    "negative: {values:?}"
                );
            }
        }
        true
    },
};

pub(super) const PBRT: Reader = Reader {
    name: "pbrt",
    seeds: || {
        vec![
            seed(
                "two.brdf",
                "2 450 650  # wavelengths\n 0.1 0 0.2 3.14  0.25 0.5\n0 0 1 -7 1e-9 -2",
            ),
            seed("one.brdf", "1\n500.5\n0.1 0 0.2 3.14\n0.25"),
            seed("bad-count.brdf", "1e9 500\n"),
            seed("bad-half.brdf", "1 500 0.1 0.2\n"),
        ]
    },
    read: |bytes| {
        let Some(samples) = read(bytes, || pbrt::from_reader(bytes, "some.brdf")) else {
            return false;
        };
        sound(&samples);
        let again = pbrt::from_reader(pbrt_text(&samples).as_bytes(), "again.brdf");
        same(&again.expect("what was written can be read"), &samples);
        true
    },
};

fn seed(name: &'static str, text: &str) -> Seed {
    Seed {
        name,
        bytes: text.into(),
    }
}

/// Shapes that fit together, and directions above the horizon.
fn sound(samples: &Samples) {
    let Samples {
        directions,
        values,
        channels,
    } = samples;
    assert_eq!(values.dim(), (directions.len(), channels.len()));
    assert!(!values.is_empty(), "samples without values");
    for d in directions {
        // The cosine of the closest number to pi/2 is above zero.
        assert!(d.is_above_horizon());
        let mut parts = d.incident.iter().chain(&d.outgoing);
        assert!(parts.all(|part| part.is_finite()));
    }
}

/// The same numbers, and directions that are the same to the rounding of an angle: an azimuth beyond
/// half a turn has not always one within it that gives the same bits.
fn same(a: &Samples, b: &Samples) {
    assert_eq!((&a.values, &a.channels), (&b.values, &b.channels));
    same_directions(&a.directions, &b.directions);
}

fn same_directions(a: &[DirectionPair], b: &[DirectionPair]) {
    let parts = |pairs: &[DirectionPair]| {
        let all = pairs.iter().flat_map(|pair| [pair.incident, pair.outgoing]);
        all.flatten().collect::<Vec<f64>>()
    };
    let (a, b) = (parts(a), parts(b));
    assert_eq!(a.len(), b.len());
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-15));
}

/// Lines of numbers with all their digits; the writer of the crate rounds.
fn table_text(directions: &[DirectionPair]) -> String {
    let lines = directions.iter().enumerate().map(|(index, d)| {
        let (number, d) = (index + 1, Angles::of(d));
        format!(
            "{number} {:?} {:?} {:?} {:?}\n",
            d.theta_o, d.phi_o, d.theta_i, d.phi_i
        )
    });
    lines.collect()
}

fn values_text(value: impl Fn(usize, usize) -> f64) -> String {
    let mut text = String::new();
    for material in 0..curet::MATERIALS {
        // Writing to a string cannot fail.
        let _ = write!(text, "{}", material + 1);
        for measurement in 0..curet::MEASUREMENTS {
            let _ = write!(text, " {}", value(material, measurement));
        }
        text.push('\n');
    }
    text
}

fn pbrt_text(samples: &Samples) -> String {
    let wavelengths = samples
        .channels
        .iter()
        .map(|channel| channel.trim_end_matches(" nm"));
    let mut text = format!(
        "{} {}",
        samples.channels.len(),
        wavelengths.collect::<Vec<_>>().join(" ")
    );
    for (d, values) in samples.directions.iter().zip(samples.values.rows()) {
        let d = Angles::of(d);
        let angles = [d.theta_i, d.phi_i, d.theta_o, d.phi_o];
        for number in angles.iter().chain(values) {
            // Writing to a string cannot fail.
            let _ = write!(text, " {number:?}");
        }
    }
    text
}

/// The smallest material there can be: every table 2 x 2.
fn rgl_file(rgb: bool) -> Vec<u8> {
    let floats = |count: usize| {
        (0..count)
            .map(|k| 0.5 + k as f32 / 8.0)
            .collect::<Vec<f32>>()
    };
    let channels = if rgb { 3 } else { 1 };
    let values = if rgb { "rgb" } else { "spectra" };
    let mut fields: Vec<(&str, Vec<u64>, Vec<f32>)> = vec![
        ("phi_i", vec![1], vec![0.0]),
        ("theta_i", vec![1], vec![0.5]),
        ("ndf", vec![2, 2], floats(4)),
        ("sigma", vec![2, 2], floats(4)),
        ("vndf", vec![1, 1, 2, 2], floats(4)),
        (
            values,
            vec![1, 1, channels, 2, 2],
            floats(4 * channels as usize),
        ),
    ];
    if !rgb {
        fields.push(("wavelengths", vec![1], vec![550.0]));
    }
    let mut out = b"tensor_file\0\x01\0".to_vec();
    let described: usize = fields
        .iter()
        .map(|(name, shape, _)| 13 + name.len() + 8 * shape.len())
        .sum();
    let jacobian = "jacobian";
    let mut offset = out.len() + 4 + described + 13 + jacobian.len() + 8;
    out.extend((fields.len() as u32 + 1).to_le_bytes());
    let mut describe = |name: &str, code: u8, shape: &[u64], length: usize| {
        out.extend((name.len() as u16).to_le_bytes());
        out.extend(name.as_bytes());
        out.extend((shape.len() as u16).to_le_bytes());
        out.push(code);
        out.extend((offset as u64).to_le_bytes());
        out.extend(shape.iter().flat_map(|size| size.to_le_bytes()));
        offset += length;
    };
    for (name, shape, numbers) in &fields {
        describe(name, 10, shape, 4 * numbers.len());
    }
    describe(jacobian, 1, &[1], 1);
    for (_, _, numbers) in &fields {
        out.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    }
    out.push(1);
    out
}
