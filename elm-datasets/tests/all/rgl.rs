//! The RGL format, on files made from formulas: every step has a known answer.

use std::f64::consts::PI;
use std::fs;
use std::path::Path;

use crate::bsdf::{Field, Ggx, bytes, file, floats, tabulate};
use elm_datasets::rgl::{Channels, Problem, Rgl};
use elm_datasets::{Angles, DirectionPair, Error, Sampling, scattered};

const ELEVATIONS: [f64; 2] = [0.25, 1.0];

/// Tables of 2 x 2, each exact for what it stands for. All numbers are exact in 32 bits.
fn on_paper(values: &'static str, jacobian: u8) -> Vec<Field> {
    // Seen from 0.25 the density x + y, from 1.0 the uniform one; both have integral 1.
    let vndf = [tabulate(2, 2, |x, y| x + y), vec![1.0; 4]].concat();
    let tables: Vec<f64> = (0..6)
        .flat_map(|k| tabulate(2, 2, |x, y| smooth(k, x, y)))
        .collect();
    let mut fields = vec![
        bytes("description", b"on paper"),
        floats("phi_i", &[1], &[0.0]),
        floats("theta_i", &[2], &ELEVATIONS),
        floats("ndf", &[2, 2], &tabulate(2, 2, |x, y| 3.0 + x + 2.0 * y)),
        floats("sigma", &[2, 2], &tabulate(2, 2, |x, _| 0.5 + 0.25 * x)),
        floats("vndf", &[1, 2, 2, 2], &vndf),
        floats(values, &[1, 2, 3, 2, 2], &tables),
        bytes("jacobian", &[jacobian]),
    ];
    if values == "spectra" {
        fields.push(floats("wavelengths", &[3], &[360.0, 500.5, 1000.0]));
    }
    fields
}

/// Table k: elevation k / 3, channel k % 3.
fn smooth(k: usize, x: f64, y: f64) -> f64 {
    let k = k as f64;
    1.0 + k + x * (k - 2.0) / 4.0 + 2.0 * y + x * y
}

/// The value on paper, by the publication's formulas.
fn expected(pair: &DirectionPair, channel: usize, jacobian: bool) -> f64 {
    let d = Angles::of(pair);
    let unit = |theta: f64, phi: f64| {
        [
            theta.sin() * phi.cos(),
            theta.sin() * phi.sin(),
            theta.cos(),
        ]
    };
    let (i, o) = (unit(d.theta_i, d.phi_i), unit(d.theta_o, d.phi_o));
    let m = [i[0] + o[0], i[1] + o[1], i[2] + o[2]];
    let theta_m = m[0].hypot(m[1]).atan2(m[2]);
    let turned = (m[1].atan2(m[0]) - d.phi_i).rem_euclid(2.0 * PI);
    // (phi + pi) / 2 pi, modulo 1.
    let (x, y) = (
        (2.0 * theta_m / PI).sqrt(),
        (turned / (2.0 * PI) + 0.5).fract(),
    );
    let w = ((d.theta_i - 0.25) / 0.75).clamp(0.0, 1.0);
    let s = |a: f64, b: f64| (1.0 - w) * a + w * b;
    // The blend of the densities, integrated along the row and then across the rows.
    let u = s(x * x / 2.0 + x * y, x) / s(y + 0.5, 1.0);
    let v = s((y * y + y) / 2.0, y);
    let rest = s(smooth(channel, u, v), smooth(channel + 3, u, v));
    let highlight = if jacobian {
        (3.0 + x + 2.0 * y) / (4.0 * (0.5 + 0.25 * (2.0 * d.theta_i / PI).sqrt()))
    } else {
        1.0
    };
    rest * highlight / d.theta_o.cos()
}

fn random(rows: usize) -> Vec<DirectionPair> {
    Sampling::Random { rows, seed: 3 }.directions().unwrap()
}

#[test]
fn tables_that_are_exact_give_the_value_on_paper() {
    for (values, jacobian) in [("rgb", 1), ("rgb", 0), ("spectra", 1)] {
        let rgl = Rgl::from_bytes(&file(&on_paper(values, jacobian))).unwrap();
        for pair in random(2000) {
            for (channel, found) in rgl.at(&pair).into_iter().enumerate() {
                let expected = expected(&pair, channel, jacobian == 1);
                // A few dozen roundings; the square root near the normal turns 1e-16 in theta_m
                // into up to 1e-8 in x only for theta_m below 1e-16.
                assert!((found - expected).abs() < 1e-12 * expected, "{pair:?}");
            }
        }
    }
}

/// `benches/peers/rgl_mitsuba.py` has made the files, and asked the format's authors' renderer for
/// the values.
#[test]
fn the_authors_renderer_gives_the_same_values() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    for name in ["rgb", "spectral"] {
        let path = |end: &str| data.join(format!("mitsuba-{name}.{end}"));
        let rgl = Rgl::read(path("bsdf")).unwrap();
        let theirs = scattered::read(path("csv"), &scattered::Options::default()).unwrap();
        assert_eq!(rgl.channels().names(), theirs.channels);
        assert_eq!(theirs.values.nrows(), 200);
        for (pair, values) in theirs.directions.iter().zip(theirs.values.rows()) {
            for (found, &expected) in rgl.at(pair).into_iter().zip(values) {
                // The renderer calculates in 32 bits, 6e-8 for each of some hundred operations,
                // and divides by cosines down to 0.05.
                let error = (found / expected - 1.0).abs();
                assert!(error < 1e-4, "{name}, {pair:?}: {found} against {expected}");
            }
        }
    }
}

#[test]
fn turning_light_and_viewer_together_changes_nothing() {
    let rgl = Rgl::from_bytes(&file(&on_paper("rgb", 1))).unwrap();
    for (pair, turn) in random(200).into_iter().zip(0..) {
        let turn = f64::from(turn) / 10.0;
        let angles = Angles::of(&pair);
        let turned = DirectionPair::from(Angles {
            phi_i: angles.phi_i + turn,
            phi_o: angles.phi_o + turn,
            ..angles
        });
        for (a, b) in rgl.at(&pair).into_iter().zip(rgl.at(&turned)) {
            // Azimuths up to 20 lose 4e-15.
            assert!((a - b).abs() < 1e-12 * a);
        }
    }
}

/// Largest and mean relative error against the formula, at elevations that the file has.
fn errors(coarse: usize) -> (f64, f64) {
    let ggx = Ggx {
        alpha: 0.4,
        facet: [0.5, 1.0, 0.25],
    };
    let elevations: Vec<f64> = [0.0, 0.3, 0.6, 0.9, 1.2].to_vec();
    let rgl = Rgl::from_bytes(&ggx.file(&elevations, 97, coarse)).unwrap();
    let (mut worst, mut sum, mut count) = (0.0_f64, 0.0, 0);
    for (pair, k) in random(2000).into_iter().zip(0..) {
        // As the file has them, in 32 bits.
        let angles = Angles {
            theta_i: f64::from(elevations[k % 5] as f32),
            ..Angles::of(&pair)
        };
        let pair = DirectionPair::from(angles);
        // Towards the horizon the shadowing is too steep for tables this coarse.
        if angles.theta_o > 1.1 {
            continue;
        }
        let cos_between = pair.cos_between();
        let (cos_i, cos_o) = (pair.incident[2], pair.outgoing[2]);
        let cos_m = (cos_i + cos_o) / (2.0 + 2.0 * cos_between).sqrt();
        let exact = ggx.brdf(cos_i, cos_o, cos_m.min(1.0).acos());
        for (found, facet) in rgl.at(&pair).into_iter().zip(ggx.facet) {
            let error = (found / (facet * exact) - 1.0).abs();
            worst = worst.max(error);
            sum += error;
            count += 1;
        }
    }
    (worst, sum / f64::from(count))
}

#[test]
fn a_microfacet_model_comes_back_with_an_error_of_second_order() {
    // Halving the step quarters the error of bilinear interpolation, less what the tables of the
    // shape add, which stay as they are: 0.8 %, 0.19 % and 0.06 % in the mean. A whole step off,
    // or a wrong factor anywhere, would leave an error that does not go away.
    let [(_, rough), (_, middle), (worst, fine)] = [9, 17, 33].map(errors);
    assert!(middle < rough / 3.0, "{rough} {middle}");
    assert!(fine < middle / 3.0, "{middle} {fine}");
    assert!(fine < 1e-3 && worst < 0.05, "{fine} {worst}");
}

#[test]
fn there_is_no_reflection_at_or_below_the_horizon() {
    let rgl = Rgl::from_bytes(&file(&on_paper("rgb", 1))).unwrap();
    for (theta_i, theta_o) in [(1.6, 0.2), (0.2, 1.6), (3.0, 3.0), (f64::NAN, 0.1)] {
        let pair = DirectionPair::from(Angles {
            theta_i,
            phi_i: 0.0,
            theta_o,
            phi_o: 1.0,
        });
        assert_eq!(rgl.at(&pair), [0.0; 3]);
    }
}

#[test]
fn out_of_gamut_colors_are_cut_off_and_spectra_are_not() {
    for (name, expected) in [("rgb", 0.0), ("spectra", -1.0)] {
        let mut fields = on_paper(name, 0);
        for field in &mut fields {
            if field.name == name {
                *field = floats(name, &[1, 2, 3, 2, 2], &[-1.0; 24]);
            }
        }
        let rgl = Rgl::from_bytes(&file(&fields)).unwrap();
        let pair = DirectionPair::from(Angles {
            theta_i: 0.5,
            phi_i: 0.0,
            theta_o: 0.0,
            phi_o: 0.0,
        });
        for value in rgl.at(&pair) {
            assert!((value - expected).abs() < 1e-15);
        }
    }
}

#[test]
fn samples_have_the_channels_of_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.bsdf");
    fs::write(&path, file(&on_paper("spectra", 1))).unwrap();
    let rgl = Rgl::read(&path).unwrap();
    assert_eq!(
        *rgl.channels(),
        Channels::Spectrum(vec![360.0, 500.5, 1000.0])
    );
    let sampling = Sampling::Grid {
        polar: 3,
        azimuth: 4,
    };
    let samples = rgl.samples(&sampling).unwrap();
    assert_eq!(samples.channels, ["360 nm", "500.5 nm", "1000 nm"]);
    assert_eq!(samples.values.dim(), (36, 3));
    assert_eq!(
        samples.values.row(7).to_vec(),
        rgl.at(&samples.directions[7])
    );
}

type Edit = fn(&mut Vec<Field>);

fn field<'a>(fields: &'a mut [Field], name: &str) -> &'a mut Field {
    fields.iter_mut().find(|field| field.name == name).unwrap()
}

/// What is damaged, the edit of the fields, and what the message must contain.
#[rustfmt::skip]
const DAMAGE: &[(&str, Edit, &[&str])] = &[
    ("no values", |f| f.retain(|x| x.name != "rgb"), &["\"wavelengths\"", "found none"]),
    ("no elevations", |f| f.retain(|x| x.name != "theta_i"), &["\"theta_i\"", "found none"]),
    ("no ndf", |f| f.retain(|x| x.name != "ndf"), &["\"ndf\"", "found none"]),
    ("no jacobian", |f| f.retain(|x| x.name != "jacobian"), &["\"jacobian\"", "found none"]),
    ("azimuths of a third", |f| *field(f, "phi_i") = floats("phi_i", &[3], &[-0.5, 0.0, 0.5]), &["\"phi_i\"", "a quarter", "57.3 degrees"]),
    ("values of one azimuth of three", |f| *field(f, "phi_i") = floats("phi_i", &[3], &[-3.0, 0.0, 3.0]), &["\"rgb\"", "(phi_i, theta_i, 3, v, u)"]),
    ("elevations of doubles", |f| { let x = field(f, "theta_i"); x.code = 11; x.shape = vec![1]; }, &["\"theta_i\"", "floats", "type 11"]),
    ("elevations in a table", |f| field(f, "theta_i").shape = vec![1, 2], &["\"theta_i\"", "[1, 2]"]),
    ("no elevation", |f| *field(f, "theta_i") = floats("theta_i", &[0], &[]), &["\"theta_i\"", "[0]"]),
    ("elevations equal", |f| *field(f, "theta_i") = floats("theta_i", &[2], &[0.5, 0.5]), &["\"theta_i\", number 1", "larger", "0.5"]),
    ("elevation not a number", |f| *field(f, "theta_i") = floats("theta_i", &[2], &[0.5, f64::NAN]), &["\"theta_i\", number 1", "finite", "NaN"]),
    ("value infinite", |f| field(f, "rgb").bytes[4..8].copy_from_slice(&f32::INFINITY.to_le_bytes()), &["\"rgb\", number 1", "finite", "inf"]),
    ("negative density", |f| field(f, "vndf").bytes[8..12].copy_from_slice(&(-1.0_f32).to_le_bytes()), &["\"vndf\", number 2", "negative", "-1"]),
    ("no density", |f| field(f, "vndf").bytes[16..].fill(0), &["\"vndf\", table 1", "zeros"]),
    ("four channels", |f| *field(f, "rgb") = floats("rgb", &[1, 2, 4, 2, 2], &[1.0; 32]), &["\"rgb\"", "(phi_i, theta_i, 3, v, u)", "[1, 2, 4, 2, 2]"]),
    ("three elevations of values", |f| *field(f, "rgb") = floats("rgb", &[1, 3, 3, 2, 2], &[1.0; 36]), &["\"rgb\"", "[1, 3, 3, 2, 2]"]),
    ("table of one column", |f| *field(f, "sigma") = floats("sigma", &[4, 1], &[1.0; 4]), &["\"sigma\"", "[4, 1]"]),
    ("unknown type", |f| field(f, "ndf").code = 12, &["\"ndf\"", "1 to 11", "found 12"]),
    ("no type", |f| field(f, "ndf").code = 0, &["\"ndf\"", "found 0"]),
    ("beyond the end", |f| field(f, "jacobian").shape = vec![2], &["\"jacobian\"", "[2]", "within the file"]),
    ("more than there is", |f| field(f, "ndf").shape = vec![u64::MAX, u64::MAX], &["\"ndf\"", "18446744073709551615", "within the file"]),
    ("a terabyte", |f| field(f, "ndf").shape = vec![1 << 19, 1 << 19], &["\"ndf\"", "524288", "within the file"]),
];

#[test]
fn damage_is_reported_with_file_field_and_expectation() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.bsdf");
    for (what, edit, fragments) in DAMAGE {
        let mut fields = on_paper("rgb", 1);
        edit(&mut fields);
        fs::write(&path, file(&fields)).unwrap();
        let Err(error) = Rgl::read(&path) else {
            panic!("{what}: read without an error")
        };
        let message = error.to_string();
        for fragment in fragments.iter().chain(&["x.bsdf"]) {
            assert!(
                message.contains(fragment),
                "{what}: no {fragment:?} in {message:?}"
            );
        }
        assert!(!message.contains('\n'), "{what}: {message}");
    }
    let error = Rgl::read(dir.path().join("none.bsdf")).unwrap_err();
    assert!(matches!(error, Error::Read { .. }));
}

#[test]
fn headers_that_are_none_are_reported_with_their_byte() {
    let whole = file(&on_paper("rgb", 1));
    let problem = |bytes: &[u8]| Rgl::from_bytes(bytes).unwrap_err();
    assert_eq!(problem(b""), Problem::NoTensorFile);
    assert_eq!(problem(b"tensor_fil"), Problem::NoTensorFile);
    let mut version = whole.clone();
    version[12] = 2;
    assert_eq!(problem(&version), Problem::Version { found: [2, 0] });
    let mut many = whole.clone();
    many[14..18].fill(255);
    // The descriptions go on into the numbers, which are none.
    assert!(Rgl::from_bytes(&many).is_err());
    let truncated = Problem::Truncated {
        at: 14,
        needed: 4,
        left: 3,
    };
    assert_eq!(problem(&whole[..17]), truncated);
    let mut name = whole.clone();
    name[20] = 0xff;
    assert_eq!(problem(&name), Problem::FieldName { at: 18 });
    for end in 0..whole.len() {
        assert!(Rgl::from_bytes(&whole[..end]).is_err(), "{end}");
    }
}
