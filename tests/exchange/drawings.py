# ruff: noqa: E501
"""Public drawings as data: PMKS+ addresses (after the "?") and a PMKS text (MIT licence), coordinates of drawings of Linkage.

LINKAGE: name -> ([anchored connectors], {driven connector: rpm}, {connector: (x, y) in mm}, [links as connectors], {slider: (from, to)}).
"""

PMKS_PLUS = {
    "4bar": "0P.TY.K,0.101.MA,A,0mv,0VU,0.GB,B,0e_,E6,0.GC,C,l1,WW,0.KD,D,qD,0Pk,0..YRAB,AB,Fe,Fe,0ix,08i,c5cae9,A,B,,.YRBC,BC,Fe,Fe,32,NJ,303e9f,B,C,,.YRCD,CD,Fe,Fe,nd,3P,0d125a,C,D,,...JBq",
    "watt_1": "0P.TY.K,0.101.MA,A,0Qh,0Kn,0.GB,B,0e1,9i,0.GC,C,bT,LF,0.GD,D,0G5,tZ,0.GE,E,V5,1_z,0.GF,F,1mM,1Gv,0.KG,G,1rt,0ey,0..YRAB,AB,Fe,Fe,0XM,05Z,c5cae9,A,B,,.YRBCD,BCD,Fe,Fe,06D,Sr,303e9f,B,C,D,,.YRDE,DE,Fe,Fe,7W,1RG,0d125a,D,E,,.YREF,EF,Fe,Fe,17j,1dx,B2DFDB,E,F,,.YRFCG,FCG,Fe,Fe,1PE,KQ,26A69A,F,C,G,,...JAp",
    "stephenson_3": "0P.TY.K,0.101.MA,A,0YP,0ce,0.GB,B,0cQ,0FI,0.GC,C,lC,1-,0.KD,D,ow,0U1,0.GE,E,033,D-,0.GF,F,Dc,nj,0.KG,G,1M0,GJ,0..YRAB,AB,Fe,Fe,0aP,0Qz,c5cae9,A,B,,.YRBCE,BCE,Fe,Fe,1w,E,303e9f,B,C,E,,.YRCD,CD,Fe,Fe,n3,0E1,0d125a,C,D,,.YREF,EF,Fe,Fe,5H,Vs,B2DFDB,E,F,,.YRFG,FG,Fe,Fe,np,X0,26A69A,F,G,,...JBe",
    "slider_crank": "0P.TY.K,0.101.MA,A,0mA,0c,0.GB,B,0Yt,bK,0.GC,C,il,H-,0.LD,D,il,H-,0..YRAB,AB,Fe,Fe,0fW,IN,c5cae9,A,B,,.YRBC,BC,Fe,Fe,4y,Rf,303e9f,B,C,,.YPCD,CD,Fe,0,0,0,,C,D,,...JAe",
}

PMKS_TEXT = "ground,input,R,100.00,100.00,0.000,tfft\ninput,coupler,R,350.00,100.00,0.000,tfff\ncoupler,output,R,400.00,480.00,0.000,tfff\noutput,ground,R,600.00,100.00,0.000,tfff\ncoupler,R,500.00,125.00,0.000,tfff\n"

LINKAGE = {
    "example1": (
        [0, 3],
        {0: 30},
        {0: (200, -100), 1: (200, -65), 2: (300, -100), 3: (300, -300)},
        [[0, 1], [1, 2], [2, 3]],
        {},
    ),
    "klann": (
        [0, 2, 4],
        {4: 15},
        {
            0: (384.18812, -263.389741),
            1: (389.964056, -172.445336),
            2: (374.335829, -342.08981),
            3: (376.117415, -281.360534),
            4: (471.970983, -296.009544),
            5: (470.517568, -332.484023),
            8: (158.277169, -418.544812),
            9: (313.573392, -224.432992),
        },
        [[0, 1], [2, 3], [4, 5], [3, 5, 9], [8, 9, 1]],
        {},
    ),
    "slider1": (
        [0, 4],
        {0: 15},
        {0: (71, -72), 1: (72, -48.5), 4: (-59, -71), 5: (203, -26)},
        [[0, 1], [4, 5]],
        {1: (4, 5)},
    ),
    "hoeken": (
        [0, 2],
        {0: -5},
        {0: (-136, -119), 1: (-136, -191), 2: (8, -119), 3: (-136, -11), 5: (-136, 169)},
        [[0, 1], [2, 3], [5, 1, 3]],
        {},
    ),
}
