"""Robots that config/robots does not have, to plan for: on a rail, with a lifting column, without a wrist, a turntable."""

ROBOTS = {
    # Lengths and limits of a Stäubli RX160L.
    "long arm": """\
name: long arm
chain: >-
  Tz(d1) Rz(q1) Tx(a1) Rx(-90deg) Rz(q2) Tx(a2) [elbow] Rz(q3) Rx(90deg) Tz(d4) Rz(q4) Rx(-90deg) Rz(q5) Rx(90deg) Rz(q6)
  Tz(d6) [tool0]
lengths_m: {d1: 0.55, a1: 0.15, a2: 0.825, d4: 0.925, d6: 0.11}
joint_limits_deg: [[-160, 160], [-137.5, 137.5], [-150, 150], [-270, 270], [-105, 120], [-270, 270]]
""",
    "on a rail": """\
name: on a rail
chain: >-
  Tx(q1) Tz(d1) Rz(q2) Tx(a1) Rx(-90deg) Rz(q3) Tx(a2) [elbow] Rz(q4) Rx(90deg) Tz(d4) Rz(q5) Rx(-90deg) Rz(q6) Rx(90deg)
  Rz(q7) Tz(d6) [tool0]
lengths_m: {d1: 0.55, a1: 0.15, a2: 0.825, d4: 0.925, d6: 0.11}
joint_limits_deg: [[0, 6], [-160, 160], [-137.5, 137.5], [-150, 150], [-270, 270], [-105, 120], [-270, 270]]
""",
    # A lifting column and seven joints, as a TIAGo has.
    "on a column": """\
name: on a column
chain: >-
  Tz(l0) Tz(q1) Tx(l1) Tz(l2) Rz(q2) Tx(l3) Rx(-90deg) Rz(q3) Tx(l4) Rx(90deg) Rz(q4) Tz(l5) [elbow] Rx(-90deg) Rz(q5)
  Rx(90deg) Tz(l6) Rz(q6) Rx(-90deg) Rz(q7) Rx(90deg) Rz(q8) Tz(l7) [tool0]
lengths_m: {l0: 0.6, l1: -0.06, l2: 0.19, l3: 0.125, l4: 0.0895, l5: 0.222, l6: 0.162, l7: 0.15}
joint_limits_deg: [[0, 0.35], [0, 157], [-86, 58], [-202, 90], [-22, 131], [-120, 120], [-81, 81], [-120, 120]]
""",
    "scara": """\
name: scara
chain: Tz(d1) Rz(q1) Tx(a1) Rz(q2) Tx(a2) [elbow] Tz(q3) Rz(q4) [tool0]
lengths_m: {d1: 0.4, a1: 0.3, a2: 0.25}
joint_limits_deg: [[-130, 130], [-140, 140], [-0.2, 0.0], [-360, 360]]
""",
    "two joints": "name: two joints\nchain: Tz(d1) Rz(q1) Tx(a1) [elbow] Rx(q2) [tool0]\nlengths_m: {d1: 0.4, a1: 0.3}\n",
    # Nothing moves far: its links are a point.
    "turntable": "name: turntable\nchain: Tz(d1) [elbow] Rz(q1) [tool0]\nlengths_m: {d1: 0.4}\n",
}
