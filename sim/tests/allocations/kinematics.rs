//! Solving inverse kinematics allocates no memory.

use kinetoscope_robot::kinematics::{Chain, IkCfg, IkSolver, NullSpacePosture};
use kinetoscope_robot::urdf::{UrdfCfg, assemble};
use kinetoscope_scene::{KeyedRng, Pose};

#[test]
fn solve() {
    let urdf = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/arms/seven_axes.urdf");
    let description = assemble(&UrdfCfg::single(urdf)).unwrap().description;
    let chain = Chain::new(&description, description.link_id("link8").unwrap(), &Pose::identity()).unwrap();
    let limits: Vec<[f64; 2]> = description
        .drivable_joints()
        .map(|(_, joint)| joint.limit.as_ref().map(|l| [l.lower.unwrap(), l.upper.unwrap()]).unwrap())
        .collect();
    let mut random = KeyedRng::keyed(3, 0, "targets");
    let mut positions = || limits.iter().map(|&[low, high]| random.uniform_range(low, high)).collect::<Vec<f64>>();
    let targets: Vec<Pose> = (0..20).map(|_| chain.pose(&positions())).collect();
    let far = Pose::translation(9.0, 0.0, 0.0);
    let cfg = IkCfg { posture: Some(NullSpacePosture::at([0.0; 7])), ..Default::default() };
    let mut solver = IkSolver::new(chain.clone(), limits, cfg).unwrap();
    let (mut solved, mut starts) = (0, 0);
    let count = crate::allocations(|| {
        for target in &targets {
            let found = solver.solve(target, &[0.0; 7]).unwrap();
            solved += u32::from(found.success);
            starts += found.seed;
        }
        assert!(!solver.solve(&far, &[0.0; 7]).unwrap().success);
    });
    assert_eq!(count, 0);
    assert!(solved >= 19 && starts > 0, "{solved} solved with {starts} further starts");
}
