//! Dense and sparse constraint Jacobians lead to the same motion: MuJoCo 4.0.0's Newton solver is known to factor a wrong
//! Hessian in some sparse cases.
//!
//! Twelve free bars (72 degrees of freedom) fall onto a plane and onto each other. Both forms solve the same problem to
//! the solver's tolerance of 1e-8; over 60 steps of 2 ms, from the first touch on, contact may amplify that a
//! hundredfold: 1e-6 m. Control: with a friction that is 1 % smaller they part by more than that.

use kinetoscope::sim::mj::{Data, compile};

fn fall(jacobian: &str, friction: f64) -> Vec<f64> {
    let bars: String = (0..12)
        .map(|i| {
            let (x, z) = (0.04 * f64::from(i % 3), 0.06 + 0.11 * f64::from(i / 3));
            format!(
                r#"<body pos="{x} {} {z}" euler="0 0 {}"><freejoint/><geom type="box" size="0.1 0.02 0.02" mass="0.1" friction="{friction} 0.005 0.0001"/></body>"#,
                0.03 * f64::from(i % 2),
                40 * i
            )
        })
        .collect();
    let xml = format!(
        r#"<mujoco><option timestep="0.002" jacobian="{jacobian}" solver="Newton"/><size njmax="2000" nconmax="400"/>
        <worldbody><geom type="plane" size="2 2 1"/>{bars}</worldbody></mujoco>"#
    );
    let model = compile(&xml, &[]).unwrap().into_model();
    let mut data = Data::new(&model).unwrap();
    let mut touched = 0;
    for _ in 0..400 {
        data.step().unwrap();
        touched += u32::from(!data.contact().is_empty());
        if touched == 60 {
            break;
        }
    }
    assert_eq!(touched, 60, "the bars meet");
    assert_eq!(data.take_warnings(), Default::default());
    data.qpos().to_vec()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

#[test]
fn dense_and_sparse_jacobians_agree() {
    let (dense, sparse) = (fall("dense", 1.0), fall("sparse", 1.0));
    let (apart, control) = (distance(&dense, &sparse), distance(&dense, &fall("dense", 0.99)));
    println!("dense - sparse {apart:e}, control {control:e}");
    assert!(apart < 1e-6, "{apart:e}");
    assert!(control > 1e-6, "{control:e}");
}
