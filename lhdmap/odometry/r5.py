from r4 import *
T_bs=se3.from_rpy(0,0.0,0,(0.5,0,2.0))
for name,kw in dict(rough=dict(rough=.12),straightsmooth=dict(rough=.005,pieces=((900.,0.,0.),),und=0.0,rng=25.), smoothstraight_rough=dict(rough=.12,pieces=((900.,0.,0.),),rng=25.),fast=dict(rough=.12,kmh=24.,distance=60.)).items():
    kw.setdefault('distance',24.)
    w,ts,cl,truth=make(1,T_bs=T_bs,**kw)
    if kw.get('rng')==25.: cl=[c._replace(points_m=c.points_m[np.linalg.norm(c.points_m,axis=1)<12]) for c in cl]
    rel=np.linalg.inv(truth[0])@truth; rr=np.random.default_rng(1)
    wh=[None]+[CloudPrior(se3.from_rpy(0,0,se3.to_rpy(d)[2]*1.0,(d[0,3]*1.01+.003*rr.standard_normal(),d[1,3],0)),np.diag([.005,.005,.002])**2) for d in np.linalg.inv(rel[:-1])@rel[1:]]
    for o in [dict(),dict(vg=False),dict(vox=.3,down=.15),dict(wheels=wh)]:
        print(name,list(o)); run2(cl,truth,T_bs,**o)
