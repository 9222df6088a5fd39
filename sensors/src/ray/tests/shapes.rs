//! Shapes against closed forms: points on the surface are where rays say they are.

use super::Dice;
use crate::ray::bvh::Stack;
use crate::ray::shape::Solid;
use crate::ray::vector::{along, dot};
use crate::ray::{Assets, Ray};
use scene::Shape;
use scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere};

fn touch(shape: impl Into<Shape>, origin: [f64; 3], direction: [f64; 3]) -> Option<(f64, [f64; 3])> {
    let direction = crate::ray::vector::unit(direction).unwrap();
    let solid = Solid::of(&shape.into(), &mut Assets::default());
    solid.touch(&Ray { origin, direction }, f64::INFINITY, &mut Stack::default()).map(|t| (t.t, t.normal))
}

/// How far outside of the shape a point is: 0 on the surface, negative inside, near the surface a distance \[m\].
fn outside(shape: &Shape, [x, y, z]: [f64; 3]) -> f64 {
    let beyond = |p: f64, h: f32| p.abs() - f64::from(h);
    match shape {
        Shape::Sphere(s) => (x * x + y * y + z * z).sqrt() - f64::from(s.radius),
        Shape::Capsule(s) => {
            let h = f64::from(s.half_length);
            (x * x + y * y + (z - z.clamp(-h, h)).powi(2)).sqrt() - f64::from(s.radius)
        }
        Shape::Ellipsoid(s) => {
            let [a, b, c] = s.radii.map(f64::from);
            let value = (x / a).powi(2) + (y / b).powi(2) + (z / c).powi(2);
            let slope = 2.0 * ((x / a / a).powi(2) + (y / b / b).powi(2) + (z / c / c).powi(2)).sqrt();
            (value - 1.0) / slope.max(1.0)
        }
        Shape::Cylinder(s) => ((x * x + y * y).sqrt() - f64::from(s.radius)).max(beyond(z, s.half_length)),
        Shape::Box(s) => beyond(x, s.half[0]).max(beyond(y, s.half[1])).max(beyond(z, s.half[2])),
        other => panic!("{} is no solid with a closed form", other.name()),
    }
}

fn solids() -> Vec<Shape> {
    vec![
        Sphere { radius: 0.4 }.into(),
        Capsule { radius: 0.2, half_length: 0.3 }.into(),
        Ellipsoid { radii: [0.1, 0.3, 0.5] }.into(),
        Cylinder { radius: 0.25, half_length: 0.4 }.into(),
        Box { half: [0.1, 0.3, 0.4] }.into(),
    ]
}

/// From 20 m away and from inside: the touched point is on the surface, nothing before it is on the other side, and the
/// normal is the gradient of the distance.
#[test]
fn rays_touch_the_surface_and_nothing_before_it() {
    let mut dice = Dice(1);
    for shape in solids() {
        let (mut hits, mut worst) = (0, 0.0f64);
        for k in 0..20_000 {
            let (far, near) = if k % 2 == 0 { (20.0, 0.5) } else { (0.4, 1.0) };
            let ray = dice.ray(far, near);
            let inside = outside(&shape, ray.origin) < 0.0;
            let steps = |to: f64| (0..400).map(move |s| to * (f64::from(s) + 0.5) / 400.0);
            let Some((t, normal)) = touch(shape.clone(), ray.origin, ray.direction) else {
                assert!(!inside, "{}: a way out is missed", shape.name());
                // Every tenth: this is the slow part.
                assert!(
                    k % 10 > 1 || steps(40.0).all(|t| outside(&shape, ray.at(t)) > 0.0),
                    "{} is missed",
                    shape.name()
                );
                continue;
            };
            hits += 1;
            worst = worst.max(outside(&shape, ray.at(t)).abs());
            assert!(
                k % 10 > 1
                    || steps(t)
                        .all(|s| (outside(&shape, ray.at(s)) < 1e-9) == inside
                            || outside(&shape, ray.at(s)).abs() < 1e-6)
            );
            let h = 1e-6;
            let slope = [0, 1, 2].map(|axis| {
                let by = [0, 1, 2].map(|k| if k == axis { h } else { 0.0 });
                (outside(&shape, along(ray.at(t), 1.0, by)) - outside(&shape, along(ray.at(t), -1.0, by))) / (2.0 * h)
            });
            // At an edge the slope is that of one face or the other.
            let facing = dot(normal, slope).abs() / dot(slope, slope).sqrt();
            assert!((dot(normal, normal) - 1.0).abs() < 1e-12);
            if dot(slope, slope).sqrt() > 0.5 && !edge(&shape, ray.at(t)) {
                assert!(facing > 1.0 - 1e-6, "{}: normal {normal:?}, slope {slope:?}", shape.name());
            }
        }
        println!("{}: {hits} hits, at most {worst:.1e} m off the surface", shape.name());
        // 20 m in double precision is known to 4e-15; grazing rays lose half of the digits along the ray, not across.
        assert!(hits > 5000 && worst < 1e-12, "{}: {hits}, {worst:e}", shape.name());
    }
}

/// Within a few micrometres of where faces meet.
fn edge(shape: &Shape, [x, y, z]: [f64; 3]) -> bool {
    let near = |p: f64, h: f32| (p.abs() - f64::from(h)).abs() < 1e-5;
    match shape {
        Shape::Box(s) => {
            [near(x, s.half[0]), near(y, s.half[1]), near(z, s.half[2])].iter().filter(|n| **n).count() > 1
        }
        Shape::Cylinder(s) => near(x.hypot(y), s.radius) && near(z, s.half_length),
        _ => false,
    }
}

#[test]
fn closed_forms() {
    // Half a metre of a ball of 0.5 m is missed by 20 m less the sagitta of the offset 0.3.
    let (t, n) = touch(Sphere { radius: 0.5 }, [0.3, 0.0, 20.0], [0.0, 0.0, -1.0]).unwrap();
    assert!((t - 19.6).abs() < 1e-13 && (n[0] - 0.6).abs() < 1e-14 && (n[2] - 0.8).abs() < 1e-13);
    assert_eq!(touch(Sphere { radius: 0.5 }, [0.0; 3], [1.0, 0.0, 0.0]).unwrap().0, 0.5, "from inside, the way out");
    assert_eq!(touch(Sphere { radius: 0.5 }, [0.0, 0.0, 2.0], [0.0, 0.0, 1.0]), None, "behind");
    let capsule = Capsule { radius: 0.25, half_length: 0.5 };
    assert_eq!(touch(capsule, [0.0, 0.0, 3.0], [0.0, 0.0, -1.0]), Some((2.25, [0.0, 0.0, 1.0])));
    assert_eq!(touch(capsule, [1.0, 0.0, 0.5], [-1.0, 0.0, 0.0]), Some((0.75, [1.0, 0.0, 0.0])));
    let cylinder = Cylinder { radius: 0.25, half_length: 0.5 };
    assert_eq!(touch(cylinder, [0.1, 0.0, 3.0], [0.0, 0.0, -1.0]), Some((2.5, [0.0, 0.0, 1.0])));
    assert_eq!(touch(cylinder, [0.0, 2.0, 0.4], [0.0, -1.0, 0.0]), Some((1.75, [0.0, 1.0, 0.0])));
    assert_eq!(touch(cylinder, [0.26, 0.0, 3.0], [0.0, 0.0, -1.0]), None);
    let cube = Box { half: [0.25, 0.5, 1.0] };
    assert_eq!(touch(cube, [3.0, 0.5, 1.0], [-1.0, 0.0, 0.0]), Some((2.75, [1.0, 0.0, 0.0])), "along an edge");
    assert_eq!(touch(cube, [0.0, 0.0, 0.5], [0.0, 0.0, 1.0]), Some((0.5, [0.0, 0.0, 1.0])));
    let ellipsoid = Ellipsoid { radii: [0.25, 0.5, 1.0] };
    assert_eq!(touch(ellipsoid, [0.0, -4.0, 0.0], [0.0, 1.0, 0.0]), Some((3.5, [0.0, -1.0, 0.0])));
}

#[test]
fn planes_are_seen_from_the_front_and_end_where_they_are_told_to() {
    let down = [0.0, 0.0, -1.0];
    assert_eq!(touch(Plane::INFINITE, [1e6, -1e6, 20.0], down), Some((20.0, [0.0, 0.0, 1.0])));
    assert_eq!(touch(Plane::INFINITE, [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]), None, "from behind");
    assert_eq!(touch(Plane::INFINITE, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]), None, "along it");
    assert_eq!(touch(Plane::INFINITE, [0.0, 0.0, 0.0], down).unwrap().0.to_bits(), 0, "on it, +0");
    let strip = Plane { half: [0.5, 0.0] };
    assert!(touch(strip, [0.5, 1e3, 1.0], down).is_some() && touch(strip, [0.51, 0.0, 1.0], down).is_none());
}
